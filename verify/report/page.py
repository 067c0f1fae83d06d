"""The report of a run as view data: the page and its Markdown are made of it by templates."""

from typing import Any

from verify.printable import words_of
from verify.report.case_view import CaseView
from verify.report.family_view import FamilyView, family_views
from verify.report.figures.style import Palette
from verify.report.overview import origin_facts, overview
from verify.report.ranking_tables import (
    compared,
    profiles_figure,
)
from verify.report.run_directory import Run

_QUESTIONS = (("accuracy", "Accuracy"), ("energy", "Energy"), ("cost", "Cost"))


def page_view(
    run: Run, cases: list[CaseView], palette: Palette, notes: list[str], short: bool = False
) -> dict[str, Any]:
    """Return what ``report.j2`` shows.

    Parameters
    ----------
    run : Run
    cases : list of CaseView
        One for each of the run's entries.
    palette : Palette
        By which they are drawn.
    notes : list of str
        What has to be said about the pictures of all cases.
    short : bool
        Whether cases, families and the reading aid are left out.
    """
    families: list[FamilyView] = []
    ranking: dict[str, Any] | None = None
    try:
        families = family_views(run, palette)
    except Exception as error:
        notes = [*notes, f"the families of scenes cannot be shown: {words_of(error)}."]
    try:
        ranking = _ranking(run.ranking)
    except Exception as error:
        notes = [*notes, f"the ranking cannot be shown: {words_of(error)}."]
    started = run.record.get("started")
    return {
        "short": short,
        "when": f"Run of {started}" if started else "Run of unknown date",
        "command": run.record.get("command") or "",
        "top": overview(run, cases),
        "cases": cases,
        "families": families,
        "ranking": ranking,
        "notes": notes,
        "origin": origin_facts(run.record),
    }


def _ranking(ranking: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return the tables of the ranking; None for a run of one solver or from before rankings."""
    if not ranking or len(ranking.get("solvers", [])) < 2:
        return None
    tables = {question: compared(ranking, question, title) for question, title in _QUESTIONS}
    figure = profiles_figure(ranking.get("profiles") or [])
    return {**ranking, "figure": figure, "tables": tables}

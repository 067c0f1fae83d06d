"""The report of a run as view data: first screen, cases, families of scenes, rankings.

The first screen says what was asked, and what came out of every case and solver. The page and
its Markdown are made of it by templates.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from verify.printable import words_of
from verify.report.answers import answers
from verify.report.case_view import CaseView
from verify.report.curves import Point, error_curves, metric_names
from verify.report.error_plots import answer_panels, key
from verify.report.notation import Cell, Table, bytes_text, error_title, number, solver_title
from verify.report.plots import Palette, Series, loglog
from verify.report.run_directory import CaseEntry, Run
from verify.report.tables import MANY, check_text
from verify.report.which import which_view
from verify.result import REFERENCE, CaseResult, Status, Verdict, VerdictRecord

_NAMED = 6  # entries of a list in the paragraph
_PLACES = 2  # of what one solver fails
_SAID = 3  # solvers or places that are named in words; of more, counts


def overview(run: Run, cases: Sequence[CaseView], palette: Palette) -> dict[str, Any]:
    """Return the first screen: counts, lists in words, the four answers, the matrix of verdicts."""
    judged = [(e, v) for e in run.entries if e.result for v in e.result.verdicts]
    solves = [s for r in run.results for s in r.solves]
    solves += [s for e in run.entries for s in e.unjudged]
    counts = Counter(str(v.verdict) for _, v in judged)
    ended = Counter(str(s.status) for s in solves if s.status is not Status.SOLVED)
    notes = [f"{defect}." for defect in run.defects]
    if (run.record.get("provenance") or {}).get("dirty"):
        notes.append(
            "the code differed from its commit when this ran: it cannot be reproduced from it."
        )
    asked = [s.solver for s in solves if s.solver != REFERENCE]
    asked += [v.solver or "nobody" for _, v in judged]
    names = [solver_title(name) for name in dict.fromkeys(asked)]
    view: dict[str, Any] = {
        "counts": {str(verdict): counts[str(verdict)] for verdict in Verdict},
        "cases": len(run.entries), "checks": len(judged), "solves": len(solves),
        "solvers": len({v.solver for _, v in judged} - {"", REFERENCE}),
        "findings": _findings(run, judged),
        "unchecked": _listed([e.name for e in run.entries if e.result and not e.result.verdicts]),
        "ended": ", ".join(f"{count} {name}" for name, count in sorted(ended.items())),
        "notes": notes, "names": names, "matrix": _matrix(run, cases, names),
        "answers": [], "key": None,
    }  # fmt: skip
    try:
        view["answers"] = _answers(run, cases, palette)
        shown = [name for name in names if name not in ("nobody", "reference")]
        view["key"] = key(shown, palette) if shown else None
    except Exception as error:
        notes.append(f"the four answers cannot be shown: {words_of(error)}.")
    return view


# what a judge alone is installed without -> what it cannot do
_WITHOUT = {
    "numba": "numba, without which xfem and the other ways to cut do not solve",
    "dolfinx": "DOLFINx, without which no reference is solved: those of bundles judge",
}


def origin_facts(record: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and value of where the numbers of a run come from."""
    origin = record.get("provenance")
    origin = dict(origin) if isinstance(origin, dict) else {}
    versions = origin.pop("versions", None)
    commit, dirty = origin.pop("commit", None), origin.pop("dirty", None)
    state = {True: ", with changes that are not committed", False: ", unchanged"}.get(dirty, "")
    said = [("command", str(record.get("command") or "unknown"))]
    if "seconds" in record:  # a study
        said.append(("took", f"{number(record['seconds'], 3)} s"))
    else:
        said.append(("started", str(record.get("started") or "unknown")))
        said.append(("finished", str(record.get("finished") or "not finished")))
    said.append(("commit", f"{commit}{state}" if commit else "unknown"))
    said += [("run again", str(rows)) for rows in record.get("run_again", [])]
    if isinstance(memory := origin.pop("memory", None), int | float):
        said.append(("memory", bytes_text(memory)))
    said += [(key, str(value)) for key, value in origin.items()]
    if isinstance(versions, dict):
        said.append(("versions", ", ".join(f"{name} {v}" for name, v in versions.items())))
        missing = [text for name, text in _WITHOUT.items() if name not in versions]
        said += [("not installed", "; ".join(missing))] if missing else []
    if isinstance(options := record.get("options"), dict):
        written = ", ".join(f"{key} {value}" for key, value in options.items() if value is not None)
        said.append(("options", written))
    return said


_Judged = list[tuple[CaseEntry, VerdictRecord]]


def _findings(run: Run, judged: _Judged) -> list[tuple[str, str]]:
    """Return verdicts that are no plain pass, failures first: in words, or counted if many."""
    marked = {word: [(e, v) for e, v in judged if v.verdict is word] for word in Verdict}
    failed = marked[Verdict.FAIL]
    errors = _unjudged(marked[Verdict.ERROR])
    lost = [f"{e.name}: {_clause(e.defect)}" for e in run.entries if e.result is None]
    warned: dict[str, dict[str, list[str]]] = {}
    for entry in run.entries:
        for w in entry.result.warnings if entry.result else []:
            whose = solver_title(w.solver) if w.solver else "every solver"
            warned.setdefault(w.about, {}).setdefault(entry.name, []).append(whose)

    def of_solvers(some: _Judged) -> str:
        said = _by_solver(some, judged)
        return "; ".join(said) if len(said) <= _SAID else _counted(some, judged)

    undecided = [
        f"{e.name} ({check_text(v)}): {_clause(v.reason)}" for e, v in marked[Verdict.UNDECIDED]
    ]
    # the text of each stands on top of its case
    warnings = [
        f"{about} in {name} ({', '.join(whose)})"
        for about, places in warned.items()
        for name, whose in places.items()
    ]
    counts = [f"{about} in {len(places)} case{'s' * (len(places) != 1)}"
              for about, places in warned.items()]  # fmt: skip
    lists = {
        "Failed": of_solvers([(e, v) for e, v in failed if not v.known]),
        "Failed, known findings": of_solvers([(e, v) for e, v in failed if v.known]),
        "Undecided": "; ".join(undecided) if len(undecided) <= _SAID
        else _counted(marked[Verdict.UNDECIDED], judged),
        "Not judged": "; ".join([
            *(errors if len(errors) <= _SAID else [_counted(marked[Verdict.ERROR], judged)]),
            *([_listed(lost)] if lost else []),
        ]),
        "Warned of": "; ".join(warnings if len(warnings) <= _SAID else counts),
    }  # fmt: skip
    return [(title, words) for title, words in lists.items() if words]


def _counted(some: _Judged, judged: _Judged) -> str:
    """Say how many checks these are, and how many of each solver's, most first."""
    made = Counter(v.solver for _, v in judged)
    parts = [f"{solver_title(solver or 'nobody')} {count} of {made[solver]}"
             for solver, count in Counter(v.solver for _, v in some).most_common()]  # fmt: skip
    return f"{len(some)} checks, by solver: {', '.join(parts)}"


def _unjudged(errors: _Judged) -> list[str]:
    """Say of each solver how many checks could not be judged, and why the first could not."""
    whose: dict[str, list[str]] = {}
    for entry, record in errors:
        said = whose.setdefault(record.solver or "nobody", [])
        said.append(f"{entry.name}: {_clause(record.reason)}")
    return [
        f"{solver_title(name)}, {len(said)} check{'s' * (len(said) > 1)}, first {said[0]}"
        for name, said in whose.items()
    ]


def _by_solver(failed: _Judged, judged: _Judged) -> list[str]:
    """Say of each solver what it fails, the one that fails most first."""
    said = []
    for solver, count in Counter(v.solver for _, v in failed).most_common():
        made = sum(v.solver == solver for _, v in judged)
        where: dict[str, list[str]] = {}
        for entry, record in failed:
            if record.solver == solver:
                where.setdefault(entry.name, []).append(check_text(record, named=False))
        found = [f"{name} ({', '.join(whats)})" for name, whats in where.items()]
        places = "; ".join(found[:_PLACES])
        places += f"; and {len(found) - _PLACES} more cases" if len(found) > _PLACES else ""
        checks = "1 check" if made == 1 else f"{made} checks"
        said.append(f"{solver_title(solver)}, {count} of its {checks}: {places}")
    return said


def _matrix(run: Run, cases: Sequence[CaseView], names: Sequence[str]) -> Table:
    """Return the verdict of each solver in each case, with its failed share."""
    rows = []
    for entry, case in zip(run.entries, cases, strict=True):
        n = len(case.warnings)
        said = f"⚠ {n} warning{'s' * (n > 1)}" if n else ""
        whole = Cell("", said, verdict=str(case.verdict))
        marks = [_mark(entry, name, case.by_solver.get(name, "")) for name in names]
        rows.append([Cell(case.title, case.name, link=case.anchor), whole, *marks])
    kind = "matrix many" if len(names) > MANY else "matrix"
    return Table("Verdicts", ["case", "whole", *names], rows, kind, True)


def _mark(entry: CaseEntry, name: str, verdict: str) -> Cell:
    own = [v for v in entry.result.verdicts if solver_title(v.solver or "nobody") == name] \
        if entry.result else []  # fmt: skip
    if verdict:
        bad = [v for v in own if str(v.verdict) == verdict]
        known = verdict == "FAIL" and all(v.known for v in bad)
        share = f"{len(bad)} of {len(own)}" if verdict != "PASS" and len(own) > 1 else ""
        said = "known finding" if known else share
        unsure = max((v.reference_share or 0.0, v.badge) for v in own)[1]
        return Cell("", "; ".join(filter(None, (said, unsure))), verdict=verdict)
    solves = entry.result.solves if entry.result else entry.unjudged
    ends = Counter(str(s.status) for s in solves if solver_title(s.solver) == name)
    words = ["compared only" if name == str(Status.SOLVED) else name for name in ends]
    return Cell(", ".join(words) if words else "–")


def _answers(run: Run, cases: Sequence[CaseView], palette: Palette) -> list[dict[str, Any]]:
    """Return the four answers with panel and the case drawn there; some have a sentence alone."""
    found, by_name = answers(run.results), {case.name: case for case in cases}
    return [
        {"question": one.question, "sentence": one.sentence, "panel": panel,
         "case": by_name.get(one.example)}
        for one, panel in zip(found, answer_panels(run.results, found, palette), strict=True)
    ]  # fmt: skip


def _listed(parts: list[str]) -> str:
    rest = len(parts) - _NAMED
    shown = "; ".join(parts[:_NAMED])
    return shown if rest <= 0 else f"{shown}; and {rest} more in the table"


def _clause(sentence: str) -> str:
    return sentence.rstrip(". ") or "no reason given"


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
        On the pictures of all cases.
    short : bool
        Whether cases, families and the reading aid are left out.
    """
    families: list[dict[str, Any]] = []
    ranking: dict[str, Any] | None = None
    try:
        families = family_views(run, palette)
    except Exception as error:
        notes = [*notes, f"the families of scenes cannot be shown: {words_of(error)}."]
    try:
        ranking = which_view(run.ranking, run.results)
    except Exception as error:
        notes = [*notes, f"the ranking cannot be shown: {words_of(error)}."]
    started = run.record.get("started")
    return {
        "short": short,
        "when": f"Run of {started}" if started else "Run of unknown date",
        "command": run.record.get("command") or "",
        "top": overview(run, cases, palette),
        "cases": cases,
        "families": families,
        "ranking": ranking,
        "notes": notes,
        "origin": origin_facts(run.record),
    }


def family_views(run: Run, palette: Palette) -> list[dict[str, Any]]:
    """Return the families of a run that have more than one row, each with a part for each error.

    A part has the finest point of each solver, by value and name, and a panel of them.
    """
    families: dict[str, list[CaseResult]] = {}
    for result in run.results:
        if result.row is not None:
            families.setdefault(result.row["family"], []).append(result)
    return [_family(name, rows, palette) for name, rows in families.items() if len(rows) > 1]


def _family(name: str, results: list[CaseResult], palette: Palette) -> dict[str, Any]:
    rows = sorted(results, key=lambda result: -_row(result)["value"])
    parameter, parts = _row(rows[0])["parameter"], []
    for metric in dict.fromkeys(metric for row in rows for metric in metric_names(row)):
        found = {float(_row(row)["value"]): _finest(row, metric) for row in rows}
        solvers = list(dict.fromkeys(label for one in found.values() for label in one))
        title, panel = error_title(metric), None
        if sum(x > 0 for x in found) > 1:
            series = [
                Series(label, [(x, one[label].value if label in one else None)
                               for x, one in sorted(found.items())])
                for label in solvers
            ]  # fmt: skip
            panel = loglog(title, parameter, series, palette)
        if solvers:
            parts.append({"title": title, "solvers": solvers, "found": found, "panel": panel})
    return {"name": name, "parameter": parameter, "parts": parts}


def _row(result: CaseResult) -> Mapping[str, Any]:
    return result.row or {}


def _finest(result: CaseResult, metric: str) -> dict[str, Point]:
    """Return the last point of each curve of a row by its label."""
    return {curve.label: curve.points[-1] for curve in error_curves(result, metric)}

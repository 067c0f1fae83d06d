"""The page as a whole: one file, nothing fetched; a script only where bodies can be turned."""

from importlib.resources import files

from verify.printable import words_of
from verify.report.case_section import case_section, failed_section
from verify.report.family_section import family_section
from verify.report.markup import Markup, joined, tag
from verify.report.origin import origin_section, reading_guide
from verify.report.pictures import CasePictures
from verify.report.ranking_section import ranking_section
from verify.report.run_directory import CaseEntry, Run
from verify.report.summary import summary, verdict_table
from verify.report.turntable import turntable_script

__all__ = ["page"]


def page(run: Run, pictures: list[CasePictures], notes: list[str]) -> Markup:
    """Return the report as HTML.

    Parameters
    ----------
    run : Run
    pictures : list of CasePictures
        One for each of the run's entries.
    notes : list of str
        What has to be said about the pictures of all cases.
    """
    style = Markup(files("verify.report").joinpath("style.css").read_text(encoding="utf-8"))
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", "Verification report"),
        tag("style", style),
    )
    started = run.record.get("started")
    when = f"Run of {started}" if started else "Run of unknown date"
    try:
        which = ranking_section(run.ranking)
    except Exception as error:
        which = tag("p", f"The ranking cannot be shown: {words_of(error)}.", class_="warning")
    links = [("#reading", "how to read this"), ("#provenance", "provenance")]
    if which is not None:
        links.insert(0, ("#which", "which solver"))
    top = tag(
        "header",
        tag("h1", "Verification report"),
        tag(
            "p",
            when,
            [joined(" · ", tag("a", words, href=to)) for to, words in links],
            class_="quiet",
        ),
        class_="top",
    )
    sections = [
        _section(index, entry, shown)
        for index, (entry, shown) in enumerate(zip(run.entries, pictures, strict=True))
    ]
    body = tag(
        "main",
        summary(run),
        [tag("p", "Note: " + note, class_="warning") for note in notes],
        verdict_table(run),
        which,
        _families(run),
        sections,
        reading_guide(),
        origin_section(run),
    )
    turned = any(picture.turned for shown in pictures for picture in shown.all)
    script = turntable_script() if turned else None
    whole = tag("html", head, tag("body", top, body, script), lang="en")
    return joined(Markup("<!DOCTYPE html>\n"), whole)


def _families(run: Run) -> Markup | None:
    try:
        return family_section(run)
    except Exception as error:
        text = f"The families of scenes cannot be shown: {words_of(error)}."
        return tag("p", text, class_="warning")


def _section(index: int, entry: CaseEntry, pictures: CasePictures) -> Markup:
    """Return the section of a case; if that fails, the others are shown all the same."""
    try:
        return case_section(index, entry, pictures)
    except Exception as error:
        return failed_section(index, entry, words_of(error))

"""Renders a run directory: ``report.html``, ``results.json``, ``results.csv``, ``junit.xml``."""

from importlib import import_module
from pathlib import Path
from typing import Any

from PIL import Image

from verify.report.case_view import case_view, show_pictures
from verify.report.drawing import drawn_before, drawn_case, run_palette
from verify.report.exports import csv_rows, json_document, junit_document
from verify.report.page import page_view
from verify.report.picture import CasePictures
from verify.report.printing import print_page
from verify.report.run_directory import Run, load_run
from verify.report.template_sets import as_html, as_markdown, load_templates
from verify.whole_files import write_whole

# of the provenance, what says something to a reader elsewhere
_PUBLISHED = (
    "command", "finished", "commit", "run again", "memory", "cpu", "cores", "load", "threads",
    "versions",
)  # fmt: skip
_PAGE_BYTES = 14_500_000  # what a mail system or a code host still takes


def load() -> None:
    """Load what `render` needs only when it begins: templates, readers and writers of files."""
    import_module("meshio")
    Image.init()
    load_templates("html", "report.j2")


def render(directory: Path, drawings: Path | None = None) -> Path:
    """Write the report of the run in `directory`, finished or not, into it.

    Each file is replaced in one step. The same directory gives the same bytes again, pictures
    aside from what a renderer may change.

    Parameters
    ----------
    directory : Path
    drawings : Path, optional
        Folder in which `verify.report.drawing` has left cases of this run. What is read there is
        trusted: it is one that the caller has made for it.

    Returns
    -------
    Path
        The HTML page.

    Raises
    ------
    InputError
        If `directory` holds no run.
    OSError
        If the files cannot be written.
    """
    return _written(load_run(directory), directory, drawings)[0]


def _written(
    run: Run, directory: Path, drawings: Path | None = None
) -> tuple[Path, dict[str, Any]]:
    """Write the page and the exports; return the page and what it shows."""
    palette, cases = run_palette(run.record), []
    for index, entry in enumerate(run.entries):
        made = drawn_before(drawings / f"{entry.folder.name}.pickle", palette) if drawings else None
        cases.append((made or drawn_case(run.root, index, entry, palette)).view)
    pictures = [case.pictures for case in cases]
    notes: list[str] = []
    view = page_view(run, cases, palette, notes)
    text = as_html("report.j2", **view, turnable=_turnable(pictures))
    excess = len(text.encode("utf-8")) - _PAGE_BYTES
    if excess > 0:
        notes.append(_left_out(pictures, excess))
        for case in cases:
            show_pictures(case)
        view = page_view(run, cases, palette, notes)
        text = as_html("report.j2", **view, turnable=_turnable(pictures))
    write_whole(directory / "results.json", json_document(run))
    write_whole(directory / "results.csv", csv_rows(run))
    write_whole(directory / "junit.xml", junit_document(run))
    target = directory / "report.html"
    write_whole(target, text)
    return target, view


def _turnable(pictures: list[CasePictures]) -> bool:
    return any(picture.turned for shown in pictures for picture in shown.all)


def render_markdown(directory: Path) -> Path:
    """Write ``report.md`` with its pictures beside it, and all that `render` writes.

    Raises
    ------
    InputError, OSError
        As `render`.
    """
    _, view = _written(load_run(directory), directory)
    target = directory / "report.md"
    write_whole(target, as_markdown("report.j2", directory, **view))
    return target


def render_summary(directory: Path) -> Path:
    """Write ``summary.md``: the verdicts, the rankings, where it comes from; no page per case.

    Raises
    ------
    InputError, OSError
        As `render`.
    """
    run = load_run(directory)
    palette, none = run_palette(run.record), CasePictures()
    cases = [case_view(i, entry, none, palette) for i, entry in enumerate(run.entries)]
    view = page_view(run, cases, palette, [], short=True)
    view["origin"] = [fact for fact in view["origin"] if fact[0] in _PUBLISHED]
    target = directory / "summary.md"
    write_whole(target, as_markdown("report.j2", directory, **view))
    write_whole(directory / "results.csv", csv_rows(run))
    return target


def render_pdf(directory: Path) -> Path:
    """Write ``report.pdf``, and all that `render` writes.

    Raises
    ------
    InputError, OSError
        As `render`; also if there is no browser that prints.
    """
    target = directory / "report.pdf"
    print_page(render(directory), target)
    return target


def _left_out(pictures: list[CasePictures], excess: int) -> str:
    """Leave out what can be turned, then pictures, of the last cases, by `excess` bytes."""
    stills = dropped = 0
    total = sum(len(shown.all) for shown in pictures)
    for picture in [picture for shown in reversed(pictures) for picture in shown.all]:
        if excess > 0 and (size := sum(map(len, picture.turned.values()))):
            excess, stills, picture.turnable = excess - size, stills + 1, False
    for shown in reversed(pictures):
        if excess <= 0:
            break
        excess -= sum(4 * len(picture.image) // 3 for picture in shown.all)
        dropped += len(shown.all)
        shown.deformed, shown.error, shown.tip, shown.film = [], [], [], []
        shown.notes.append("Its pictures are left out to keep the page small.")
    said = [f"{stills} bodies are shown as stills"] if stills else []
    said += [f"{dropped} of {total} pictures are left out"] if dropped else []
    return f"{', '.join(said)} to keep the page below {_PAGE_BYTES / 1e6:.3g} MB."

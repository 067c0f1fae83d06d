"""Renders a run directory: ``report.html``, ``results.json``, ``results.csv``, ``junit.xml``.

Cases may have been drawn before, beside the solves of other cases: `main` does so. Each question in
its folder names a run directory, the folder of a case in it, and the file to write. What is written
is read back by the process that asked for it, and by nobody else.
"""

import pickle
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from time import sleep
from typing import Any, NoReturn

from PIL import Image

from verify.json_files import read_json, write_json
from verify.printable import words_of
from verify.processes import die_with_parent
from verify.report.case_view import CaseView, case_view, show_pictures
from verify.report.drawn_bodies import draw
from verify.report.forms import as_html, as_markdown, load_templates, print_page
from verify.report.notation import solver_title
from verify.report.page import page_view
from verify.report.pictures import CasePictures, case_pictures
from verify.report.plots import Palette, Style
from verify.report.run_directory import (
    CaseEntry,
    Run,
    all_results,
    csv_rows,
    junit_document,
    load_entry,
    load_record,
    load_run,
)
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


def render(directory: Path, form: str = "html", drawings: Path | None = None) -> Path:
    """Write the report of the run in `directory`, finished or not, into it.

    Each file is replaced in one step. The same directory gives the same bytes again, pictures
    aside from what a renderer may change.

    Parameters
    ----------
    directory : Path
    form : {"html", "markdown", "pdf", "summary"}
        Markdown has its pictures beside it. The page and the files for programs are written with
        it and with PDF. A summary is Markdown without the cases: the verdicts, the rankings, where
        they come from; with it comes the CSV file alone.
    drawings : Path, optional
        Folder in which `verify.report.rendering` has left cases of this run. What is read there is
        trusted: it is one that the caller has made for it.

    Returns
    -------
    Path
        What `form` names.

    Raises
    ------
    InputError
        If `directory` holds no run; if PDF is asked for and no browser prints.
    OSError
        If the files cannot be written.
    """
    run = load_run(directory)
    if form == "summary":
        return _summary(run, directory)
    page, view = _written(run, directory, drawings)
    if form == "markdown":
        page = directory / "report.md"
        write_whole(page, as_markdown("report.j2", directory, **view))
    return print_page(page) if form == "pdf" else page


def _written(run: Run, directory: Path, drawings: Path | None) -> tuple[Path, dict[str, Any]]:
    """Write the page and the exports; return the page and what it shows."""
    palette, cases = run_palette(run.record), []
    for index, entry in enumerate(run.entries):
        made = drawn_before(drawings / f"{entry.folder.name}.pickle", palette) if drawings else None
        cases.append((made or drawn_case(run.root, index, entry, palette))[0])
    pictures = [case.pictures for case in cases]
    notes: list[str] = []

    def page() -> tuple[dict[str, Any], str]:
        view = page_view(run, cases, palette, notes)
        turned = any(picture.turned for shown in pictures for picture in shown.all)
        return view, as_html("report.j2", **view, turnable=turned)

    view, text = page()
    excess = len(text.encode("utf-8")) - _PAGE_BYTES
    if excess > 0:
        notes.append(_left_out(pictures, excess))
        for case in cases:
            show_pictures(case)
        view, text = page()
    write_json(all_results(run), directory / "results.json")
    write_whole(directory / "results.csv", csv_rows(run))
    write_whole(directory / "junit.xml", junit_document(run))
    target = directory / "report.html"
    write_whole(target, text)
    return target, view


def _summary(run: Run, directory: Path) -> Path:
    palette, none = run_palette(run.record), CasePictures()
    cases = [case_view(i, entry, none, palette) for i, entry in enumerate(run.entries)]
    view = page_view(run, cases, palette, [], short=True)
    view["origin"] = [fact for fact in view["origin"] if fact[0] in _PUBLISHED]
    target = directory / "summary.md"
    write_whole(target, as_markdown("report.j2", directory, "summary-pictures", **view))
    write_whole(directory / "results.csv", csv_rows(run))
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


_LOOK_SECONDS = 0.02


# a case as the page shows it, and the styles that its figures give labels
Drawn = tuple[CaseView, dict[str, Style]]


def main(folder: Path) -> NoReturn:
    """Draw each case that a question in `folder` names, and remove the question."""
    die_with_parent()
    while True:
        for question in sorted(folder.glob("*.json")):
            asked = read_json(question)
            root = Path(asked["root"])
            palette = run_palette(load_record(root)[0])
            drawn = drawn_case(root, asked["index"], load_entry(root / asked["folder"]), palette)
            write_whole(Path(asked["target"]), pickle.dumps(drawn))
            question.unlink()
        sleep(_LOOK_SECONDS)


def run_palette(record: Mapping[str, Any]) -> Palette:
    """Return the styles of the solvers of a run, whichever of its cases is drawn first."""
    named = record.get("solvers")
    names = [name for name in named if isinstance(name, str)] if isinstance(named, list) else []
    return Palette.of(solver_title(name) for name in names)


def drawn_case(root: Path, index: int, entry: CaseEntry, palette: Palette) -> Drawn:
    """Draw case number `index` of a run; if its pictures fail, nothing else of it does."""
    try:
        pictures = case_pictures(root, entry)
        for picture in pictures.all:
            picture.image = draw(picture.body, picture.view)
    except Exception as error:
        pictures = CasePictures(notes=[f"The pictures of this case failed: {words_of(error)}."])
    return case_view(index, entry, pictures, palette), dict(palette)


def drawn_before(file: Path, palette: Palette) -> Drawn | None:
    """Return what `main` wrote into `file`, if the figures would have the same styles now."""
    try:
        drawn: Drawn = pickle.loads(file.read_bytes())  # our own, in a folder of this process
    except (OSError, EOFError, pickle.UnpicklingError):
        return None
    same = all(palette[label] == style for label, style in drawn[1].items())
    return drawn if same else None


if __name__ == "__main__":
    main(Path(sys.argv[1]))

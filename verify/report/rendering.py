"""Renders a run directory: ``report.html``, ``results.json``, ``results.csv``, ``junit.xml``.

The page has three forms: HTML, escaped by Jinja2, Markdown, escaped by `in_markdown`, and PDF,
which a browser without a window prints. All read the same view data and the same page; only the
macros of ``blocks`` differ.
"""

import base64
import io
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from signal import SIG_IGN, SIGINT, signal
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from verify.errors import InputError
from verify.files import whole_file, write_json, write_whole
from verify.printable import words_of
from verify.report import notation
from verify.report import run_directory as directories
from verify.report.bodies import draw
from verify.report.case_view import CaseView, case_view, show_pictures
from verify.report.notation import Cell, Drawing, Table, printable, solver_title
from verify.report.page import page_view
from verify.report.pictures import CasePictures, case_pictures
from verify.report.plots import Palette, Style
from verify.report.run_directory import CaseEntry, Run, load_run
from verify.report.which import rank

PICTURES = "report-pictures"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PRINT_SECONDS = 180.0
_SPECIAL = re.compile(r"([\\`*\[\]|])")
_SPACES = re.compile(r"[^\S\u00a0\u202f]+")  # not those that hold a number and its unit together
_START = re.compile(r"^(\s*)([#>+=-]|\d+[.)](?=\s))")
_LOOK = (
    "<style>text { font-family: sans-serif; } "
    "* { stroke-linejoin: round; stroke-linecap: butt; }</style>"
)


def as_html(template: str, **view: Any) -> str:
    """Return the page that `template` makes of `view`; text of the view cannot become markup."""
    return _environment("html").get_template(template).render(
        assets=_Inline(), style=_file("style.css"), script=_file("page.js"),
        turntable=_file("turntable.js"), **view
    )  # fmt: skip


def as_markdown(template: str, folder: Path, pictures: str = PICTURES, **view: Any) -> str:
    """Return the same as Markdown; its pictures are written into `pictures` below `folder`.

    Raises
    ------
    OSError
        If they cannot be written.
    """
    beside = Beside(folder / pictures)
    text = _environment("markdown").get_template(template).render(assets=beside, **view)
    return re.sub(r"[ \t]+\n", "\n", re.sub(r"\n\s*\n", "\n\n", text)).strip() + "\n"


def print_page(page: Path) -> Path:
    """Print the HTML file `page` to the PDF file beside it.

    Raises
    ------
    InputError
        If no browser of `BROWSERS` is here, or it does not print.
    """
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        wanted = f"looked for {', '.join(BROWSERS)}"
        raise InputError(
            f"PDF needs Chromium ({wanted}); --format markdown needs nothing, and any browser "
            "prints report.html"
        )
    with tempfile.TemporaryDirectory(prefix="verify-print-") as place:
        printed = Path(place) / "report.pdf"
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
            f"--user-data-dir={place}/profile", f"--print-to-pdf={printed}",
            page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            subprocess.run(command, capture_output=True, timeout=_PRINT_SECONDS)
        except subprocess.TimeoutExpired:
            raise InputError(
                f"{browser} did not print within {_PRINT_SECONDS:g} s", str(page)
            ) from None
        if not printed.is_file():
            raise InputError(f"{browser} did not print", str(page))
        with whole_file(page.with_suffix(".pdf")) as partial:
            shutil.copyfile(printed, partial)
    return page.with_suffix(".pdf")


def load_templates(kind: str, template: str) -> None:
    """Compile a page with all that it stands on, so that the first use finds them."""
    for name in (template, "page.j2", "blocks.j2"):
        _environment(kind).get_template(name)


def in_markdown(text: str) -> str:
    """Return text that Markdown shows as it is: no marks, no elements, no line breaks."""
    plain = _SPECIAL.sub(r"\\\1", _SPACES.sub(" ", text).strip())
    plain = _START.sub(lambda m: f"{m[1]}{m[2][:-1]}\\{m[2][-1]}", plain)
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _in_code(text: str) -> Markup:
    """Return text as a code span of Markdown, where nothing is escaped and nothing replaced."""
    return Markup(f"`{' '.join(printable(text).replace('`', chr(39)).split())}`")


@cache
def _environment(kind: str) -> Environment:
    made = Environment(
        loader=ChoiceLoader([PackageLoader("verify.report", f"templates/{kind}"),
                             PackageLoader("verify.report", "templates")]),
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        finalize=_final if kind == "html" else _final_markdown, extensions=["jinja2.ext.do"],
    )  # fmt: skip
    made.globals |= {"table": Table, "cell": Cell}
    made.filters |= {
        "number": notation.number, "seconds": notation.seconds_text, "form": format, "rank": rank,
        "metric": notation.metric_title, "error": notation.error_title, "solver": solver_title,
        "signed": notation.signed, "spread": notation.spread_text, "code": _in_code,
        "scientific": notation.scientific,
    }  # fmt: skip
    return made


def _final(value: Any) -> Any:
    if isinstance(value, Markup):
        return value
    return "" if value is None else printable(value)


def _final_markdown(value: Any) -> Markup:
    """Escape for Markdown what Jinja2 would escape for HTML."""
    return value if isinstance(value, Markup) else Markup(in_markdown(_final(value)))


def _file(name: str) -> Markup:
    return Markup(files("verify.report").joinpath("templates", name).read_text(encoding="utf-8"))


class _Inline:
    """Drawings and images inside the page."""

    def __init__(self) -> None:
        self.count = 0

    def drawing(self, drawing: Drawing) -> Markup:
        """Return the inside of an SVG element, its identifiers made unique on this page."""
        self.count += 1
        return Markup(re.sub(r'( id="|href="#|url\(#)', rf"\g<1>f{self.count}-", drawing.body))

    def image(self, webp: bytes) -> str:
        """Return the image as a data address."""
        return "data:image/webp;base64," + base64.b64encode(webp).decode("ascii")


class Beside:
    """Drawings and images as files, SVG and PNG, in a folder that is made anew."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.count = folder, 0
        shutil.rmtree(folder, ignore_errors=True)  # of an earlier run
        folder.mkdir(parents=True)

    def drawing(self, drawing: Drawing) -> Markup:
        """Write an SVG file; return its path from the Markdown."""
        width, height = drawing.size
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}pt" height="{height:g}pt" '
            f'xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 {width:g} {height:g}">'
        )
        ground = '<rect width="100%" height="100%" fill="#fff"/>'  # black on dark pages else
        return self._written("svg", f"{head}{_LOOK}{ground}{drawing.body}</svg>")

    def image(self, webp: bytes) -> Markup:
        """Write a PNG file; return its path from the Markdown."""
        made = io.BytesIO()
        with Image.open(io.BytesIO(webp)) as image:
            image.save(made, "PNG", optimize=True)
        return self._written("png", made.getvalue())

    def _written(self, ending: str, content: str | bytes) -> Markup:
        self.count += 1
        name = f"{self.count:03d}.{ending}"
        write_whole(self.folder / name, content)
        return Markup(f"{self.folder.name}/{name}")


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


def render(directory: Path, form: str = "html", jobs: int = 1) -> Path:
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
    jobs : int
        Processes that draw cases side by side.

    Returns
    -------
    Path
        What `form` names.

    Raises
    ------
    InputError
        If `directory` holds no run, or PDF is wanted and no browser prints.
    OSError
        If the files cannot be written.
    """
    run = load_run(directory)
    if form == "summary":
        return _summary(run, directory)
    page, view = _written(run, directory, jobs)
    if form == "markdown":
        page = directory / "report.md"
        write_whole(page, as_markdown("report.j2", directory, **view))
    return print_page(page) if form == "pdf" else page


def _written(run: Run, directory: Path, jobs: int) -> tuple[Path, dict[str, Any]]:
    """Write the page and the exports; return the page and what it shows."""
    palette = run_palette(run.record)
    cases = _drawn_cases(run, palette, jobs)
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
    write_json(directories.all_results(run), directory / "results.json")
    write_whole(directory / "results.csv", directories.csv_rows(run))
    write_whole(directory / "junit.xml", directories.junit_document(run))
    target = directory / "report.html"
    write_whole(target, text)
    return target, view


def _summary(run: Run, directory: Path) -> Path:
    palette, none = run_palette(run.record), CasePictures()
    cases = [case_view(i, entry, none, palette, drawn=False) for i, entry in enumerate(run.entries)]
    view = page_view(run, cases, palette, [], short=True)
    view["origin"] = [fact for fact in view["origin"] if fact[0] in _PUBLISHED]
    target = directory / "summary.md"
    write_whole(target, as_markdown("report.j2", directory, "summary-pictures", **view))
    write_whole(directory / "results.csv", directories.csv_rows(run))
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


_FEWEST = 4  # cases for each process: loading what draws takes as long as drawing two or three


def _drawn_cases(run: Run, palette: Palette, jobs: int) -> list[CaseView]:
    """Draw the cases of a run, side by side where they are many."""
    asked = [(run.root, index, entry, palette) for index, entry in enumerate(run.entries)]
    made: list[CaseView] = []
    if (jobs := min(jobs, len(asked) // _FEWEST)) > 1:
        with (
            suppress(BrokenProcessPool),  # the rest is drawn here
            ProcessPoolExecutor(jobs, get_context("spawn"), signal, (SIGINT, SIG_IGN)) as pool,
        ):
            for view, styles in pool.map(drawn_case, *zip(*asked, strict=True)):
                if any(palette[label] != style for label, style in styles.items()):
                    break  # it named a curve as another process named another
                made.append(view)
    return made + [drawn_case(*one)[0] for one in asked[len(made) :]]


def run_palette(record: Mapping[str, Any]) -> Palette:
    """Return the styles of the solvers of a run, whichever of its cases is drawn first."""
    named = record.get("solvers")
    names = [name for name in named if isinstance(name, str)] if isinstance(named, list) else []
    return Palette.of(solver_title(name) for name in names)


def drawn_case(
    root: Path, index: int, entry: CaseEntry, palette: Palette
) -> tuple[CaseView, dict[str, Style]]:
    """Draw case number `index` of a run; return it with the styles that its figures give labels.

    If its pictures fail, nothing else of it does.
    """
    try:
        pictures = case_pictures(root, entry)
        for picture in pictures.all:
            picture.image = draw(picture.body, picture.view)
    except Exception as error:
        pictures = CasePictures(notes=[f"The pictures of this case failed: {words_of(error)}."])
    return case_view(index, entry, pictures, palette), dict(palette)

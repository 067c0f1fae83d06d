"""The forms of a page: HTML, escaped by Jinja2, Markdown, escaped by `in_markdown`, and PDF.

HTML and Markdown read the same view data and the same page; only the macros of ``blocks`` differ.
PDF is the HTML page printed by a browser without a window.
"""

import base64
import io
import re
import shutil
import subprocess
import tempfile
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from verify.errors import InputError
from verify.report.blocks import Cell, Drawing, Table
from verify.report.notation import (
    error_title,
    metric_title,
    number,
    printable,
    seconds_text,
    signed,
    solver_title,
    spread_text,
)
from verify.report.page import rank
from verify.whole_files import whole_file, write_whole

PICTURES = "report-pictures"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PRINT_SECONDS = 180.0
_SPECIAL = re.compile(r"([\\`*\[\]|])")
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
    target = folder / pictures
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    text = _environment("markdown").get_template(template).render(assets=Beside(target), **view)
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
    plain = _SPECIAL.sub(r"\\\1", " ".join(text.split()))
    plain = _START.sub(lambda m: f"{m[1]}{m[2][:-1]}\\{m[2][-1]}", plain)
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


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
        "number": number,
        "seconds": seconds_text,
        "metric": metric_title,
        "error": error_title,
        "form": format,
        "rank": rank,
        "solver": solver_title,
        "signed": signed,
        "spread": spread_text,
    }
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
        """Return the inside of an SVG element, its identifiers made those of this page alone."""
        self.count += 1
        return Markup(re.sub(r'( id="|href="#|url\(#)', rf"\g<1>f{self.count}-", drawing.body))

    def image(self, webp: bytes) -> str:
        """Return the image as a data address."""
        return "data:image/webp;base64," + base64.b64encode(webp).decode("ascii")


class Beside:
    """Drawings and images as files: SVG and PNG."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.count = folder, 0

    def drawing(self, drawing: Drawing) -> Markup:
        """Write an SVG file; return its path from the Markdown."""
        width, height = drawing.size
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
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

"""The report as Markdown: the same words and tables, pictures as files beside it.

Made from the page, so that both say the same; only elements that the page uses are known.
"""

import base64
import html
import io
import re
import shutil
from dataclasses import dataclass, field
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

from PIL import Image

from verify.whole_files import write_whole

__all__ = ["PICTURES", "markdown"]

PICTURES = "report-pictures"
_SVG = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_SILENT = ("head", "script", "style", "label")
_VOID = ("br", "hr", "img", "meta", "link", "wbr", "col")
_HEADINGS = {"h1": "#", "h2": "##", "h3": "###"}
_RAISED = str.maketrans("0123456789−-+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻⁺")
_SPECIAL = re.compile(r"([\\`*\[\]|])")


@dataclass
class _Element:
    name: str
    attributes: dict[str, str]
    children: list["_Element | str"] = field(default_factory=list)


class _Tree(HTMLParser):
    """The page as elements."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.root = _Element("", {})
        self.open = [self.root]
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = _Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].children.append(found)
        if tag not in _VOID:
            self.open.append(found)

    def handle_endtag(self, tag: str) -> None:
        if tag not in _VOID and len(self.open) > 1:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.open[-1].children.append(data)


def markdown(page: str, folder: Path) -> str:
    """Return the page as Markdown; its pictures are written below `folder`.

    Parameters
    ----------
    page : str
        HTML as `verify.report.page.page` makes it.
    folder : Path
        Where the Markdown will lie; `PICTURES` in it is replaced.
    """
    target = folder / PICTURES
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    pictures = _Pictures(target)
    text = _SVG.sub(pictures.drawing, page)
    blocks = _blocks(_Tree(text).root, pictures)
    return "\n\n".join(block for block in blocks if block.strip()) + "\n"


class _Pictures:
    """Writes pictures: drawings as SVG, images as PNG."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.count = folder, 0
        css = files("verify.report").joinpath("style.css").read_text(encoding="utf-8")
        rules = re.findall(r"^(?:svg|\.[\w-]+)[^{}]*\{[^{}]*\}", css, re.MULTILINE)
        self.style = (
            ":root { --ink: #1b1b1b; --quiet: #5c5c5c; --line: #c9c9c9; --faint: #ececec; }"
        )
        self.style += " svg { font-family: Times, serif; background: #fff; } " + " ".join(rules)

    def drawing(self, found: re.Match[str]) -> str:
        """Write an SVG element to a file of its own; return an image that shows it."""
        text, name = found[0], self._name("svg")
        label = re.search(r'aria-label="([^"]*)"', text)
        box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', text)
        size = f' width="{box[1]}" height="{box[2]}"' if box else ""
        opened = text.replace("<svg", f'<svg xmlns="http://www.w3.org/2000/svg"{size}', 1)
        end = opened.index(">") + 1
        styled = (
            f"{opened[:end]}<style>{html.escape(self.style, quote=False)}</style>{opened[end:]}"
        )
        write_whole(self.folder / name, styled)
        return f'<img src="{PICTURES}/{name}" alt="{label[1] if label else "drawing"}">'

    def image(self, address: str) -> str:
        """Write the image of a data address as PNG; return its path from the Markdown."""
        if not address.startswith("data:"):
            return address
        name = self._name("png")
        made = io.BytesIO()
        with Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))) as image:
            image.save(made, "PNG", optimize=True)
        write_whole(self.folder / name, made.getvalue())
        return f"{PICTURES}/{name}"

    def _name(self, ending: str) -> str:
        self.count += 1
        return f"{self.count:03d}.{ending}"


def _blocks(element: _Element, pictures: _Pictures) -> list[str]:
    """Return the blocks inside an element; text between blocks becomes a block of its own."""
    blocks: list[str] = []
    loose: list[_Element | str] = []

    def gather() -> None:
        if said := _tidy("".join(_inline(child, pictures) for child in loose)):
            blocks.append(said)
        loose.clear()

    for child in element.children:
        if isinstance(child, str) or child.name not in _BLOCKS:
            if isinstance(child, str) or child.name not in _SILENT:
                loose.append(child)
            continue
        gather()
        blocks += _block(child, pictures)
    gather()
    return blocks


_BLOCKS = (
    "html", "body", "main", "header", "section", "div", "figure", "figcaption", "p", "dl", "table",
    "h1", "h2", "h3",
)  # fmt: skip


def _block(element: _Element, pictures: _Pictures) -> list[str]:
    def words() -> str:
        return _tidy("".join(_inline(child, pictures) for child in element.children))

    if element.name in _HEADINGS:
        return [f"{_HEADINGS[element.name]} {words()}"]
    if element.name == "table":
        return _table(element, pictures)
    if element.name == "dl":
        return ["\n".join(_definitions(element, pictures))]
    if element.name == "p":
        if "turn-hint" in element.attributes.get("class", ""):
            return []  # nothing can be turned here
        return [f"> {words()}" if element.attributes.get("class") == "warning" else words()]
    return _blocks(element, pictures)


def _definitions(element: _Element, pictures: _Pictures) -> list[str]:
    lines, term = [], ""
    for child in element.children:
        if isinstance(child, str):
            continue
        said = _tidy(_inline(child, pictures))
        if child.name == "dt":
            term = said
        else:
            lines.append(f"- **{term}**: {said}")
    return lines


def _table(element: _Element, pictures: _Pictures) -> list[str]:
    title = ""
    rows: list[list[str]] = []
    for row in _all(element, ("caption", "tr")):
        if row.name == "caption":
            title = _tidy(_inline(row, pictures))
            continue
        cells: list[str] = []
        for cell in row.children:
            if isinstance(cell, _Element) and cell.name in ("td", "th"):
                said = _tidy(_inline(cell, pictures))
                if cell.name == "th" and rows and said:
                    said = f"**{said}**"
                cells += [said, *[""] * (int(cell.attributes.get("colspan", "1")) - 1)]
        rows.append(cells)
    if not rows:
        return []
    width = max(map(len, rows))
    lines = ["| " + " | ".join([*row, *[""] * (width - len(row))]) + " |" for row in rows]
    lines.insert(1, "|" + " --- |" * width)
    return [f"**{title}**" if title else "", "\n".join(lines)]


def _all(element: _Element, names: tuple[str, ...]) -> list[_Element]:
    found = []
    for child in element.children:
        if isinstance(child, _Element):
            found += [child] if child.name in names else _all(child, names)
    return found


def _inline(child: "_Element | str", pictures: _Pictures) -> str:
    if isinstance(child, str):
        return _escaped(child)
    inside = "".join(_inline(part, pictures) for part in child.children)
    match child.name:
        case "img":
            alt = _escaped(child.attributes.get("alt", ""))
            return f"![{alt}]({pictures.image(child.attributes['src'])}) "
        case "b" if inside.strip():
            return f"**{inside.strip()}**"
        case "code":
            raw = "".join(part for part in child.children if isinstance(part, str))
            return f"`{raw.replace('`', chr(39)).replace('|', chr(92) + '|')}`"
        case "sup":
            return inside.translate(_RAISED)
        case "br":
            return " "
        case "span" if "verdict" in child.attributes.get("class", "").split():
            return f"**{_tidy(inside)}**"
        case "div" | "p" | "span" | "figcaption":
            return f" {inside} "
        case name if name in _SILENT:
            return ""
    return inside


def _escaped(text: str) -> str:
    """Return text that Markdown shows as it is: no marks, no elements, no line breaks."""
    plain = _SPECIAL.sub(r"\\\1", text)
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _tidy(text: str) -> str:
    return re.sub(r" ([,.;:)])", r"\1", re.sub(r"\s+", " ", text)).strip()

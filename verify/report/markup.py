"""HTML and SVG elements whose text is escaped by construction.

String templates would need an escape at every place where a case file's words go in; here a
plain string cannot get in unescaped, and no template engine is needed.
"""

import html
from collections.abc import Sequence
from typing import Any

from verify.report.notation import printable
from verify.result import Verdict

__all__ = ["Markup", "badge", "joined", "table", "tag"]

_VOID = {"br", "hr", "img", "meta", "link", "wbr", "col"}


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def joined(*children: Any) -> Markup:
    """Return the children one after the other; plain text is escaped, None is nothing."""
    return Markup("".join(_content(child) for child in children))


def tag(element: str, *children: Any, **attributes: Any) -> Markup:
    """Return an element.

    Attribute names are written as Python allows: ``class_`` for ``class``, ``aria_label`` for
    ``aria-label``; an attribute that is None is left out.
    """
    written = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{html.escape(printable(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    if element in _VOID:
        return Markup(f"<{element}{written}>")
    return Markup(f"<{element}{written}>{joined(*children)}</{element}>")


def _content(child: Any) -> str:
    if child is None:
        return ""
    if isinstance(child, Markup):
        return child
    if isinstance(child, list | tuple):
        return joined(*child)
    return html.escape(printable(child), quote=False)


def badge(verdict: Verdict) -> Markup:
    """Return a verdict as a word in a frame."""
    return tag("span", str(verdict), class_=f"verdict {verdict.lower()}")


def table(head: Sequence[Any], rows: Sequence[Sequence[Any]], caption: str) -> Markup:
    """Return a table that scrolls sideways where the page is too narrow for it."""
    titles = tag("thead", tag("tr", [tag("th", title, scope="col") for title in head]))
    cells = tag("tbody", [tag("tr", [tag("td", cell) for cell in row]) for row in rows])
    whole = tag("table", tag("caption", caption), titles, cells)
    return tag("div", whole, class_="scroll", tabindex="0", role="region", aria_label=caption)

"""HTML and SVG elements whose text is escaped by construction.

String templates would need an escape at every place where a case file's words go in; here a
plain string cannot get in unescaped, and no template engine is needed.
"""

import html
import re
from typing import Any

__all__ = ["Markup", "joined", "printable", "tag"]

_VOID = {"br", "hr", "img", "meta", "link", "wbr", "col"}
# Control characters (not allowed in XML, invisible in HTML), and marks that turn the
# direction of the text around them
_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ufffe\uffff]")


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def printable(text: Any) -> str:
    """Return `text` without what neither XML nor UTF-8 can hold (shown as U+FFFD)."""
    whole = str(text).encode("utf-8", "replace").decode("utf-8")
    return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", whole)


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

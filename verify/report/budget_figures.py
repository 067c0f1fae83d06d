"""Figures of an error budget: a bar per source, and what each model costs."""

from collections.abc import Mapping
from typing import Any

from verify.report.axes import WIDTH, text
from verify.report.markup import Markup, joined, tag
from verify.report.notation import metric_title, number

__all__ = ["budget_section"]

_ROW, _LEFT, _RIGHT, _TOP = 30, 178, 60, 30
_COLOUR, _TOTAL = "#0067a5", "#4d4d4d"


def budget_section(record: Mapping[str, Any]) -> Markup:
    """Return the figures and tables of the record of a budget study."""
    figures = [tag("figure", _bars(budget)) for budget in record["budgets"]]
    links = tag("ol", [tag("li", name) for name in record["chain"]])
    notes = tag("ul", [tag("li", note) for note in record["notes"]]) if record["notes"] else None
    return joined(
        tag(
            "section",
            tag("h2", f"Where the error of level {record['level']} comes from"),
            tag(
                "p",
                "One thing is changed at a time. Parts of a quantity are signed and add up to its "
                "total; those of a norm are lengths, and the total is at most their sum. Lines are "
                "the uncertainty of the references on both sides and of the integration.",
                class_="quiet",
            ),
            links,
            notes,
            _missing(record),
            _ends(record),
            tag("div", figures, class_="panels"),
        ),
        tag(
            "section",
            tag("h2", "What each model costs"),
            tag(
                "p",
                "Against the problem, the first of the links above; one thread, without the "
                "background mesh. A static answer to a motion is held against it at all times. "
                "In bold: certain to be within "
                f"{100 * record['tolerance']:.3g} % of {metric_title(record['metric'])}.",
                class_="quiet",
            ),
            tag("div", _candidates(record), class_="scroll"),
        ),
    )


def _missing(record: Mapping[str, Any]) -> Markup | None:
    """Say which links could not be made."""
    if not record.get("missing"):
        return None
    titles = ("not available", "because", "where it is instead")
    head = tag("tr", [tag("th", title, scope="col") for title in titles])
    rows = [
        tag("tr", tag("td", one["source"]), tag("td", one["reason"]),
            tag("td", one["where"]))
        for one in record["missing"]
    ]  # fmt: skip
    return tag("table", tag("thead", head), tag("tbody", rows), class_="prose")


def _ends(record: Mapping[str, Any]) -> Markup | None:
    """Say where cuts end, and where the answer has their ends."""
    if not record.get("ends"):
        return None
    titles = ("end of a cut, m", "realised at", "hindmost node there", "acts as an end at")
    head = tag("tr", [tag("th", title, scope="col") for title in titles])
    rows = [
        tag("tr", tag("th", _signed(f"({x:.4g}, {y:.4g})"), scope="row"),
            tag("td", _signed(f"{one['moved']:+.2f} h")),
            tag("td", _signed(f"{one['nodes']:+.2f} h")),
            tag("td", _signed(f"{one['acts']:+.2f} ± {one['uncertainty']:.2f} h")))
        for one in record["ends"]
        for x, y in [one["place"]]
    ]  # fmt: skip
    said = (
        "Along the cut from its end as asked, positive beyond it, in elements. Without tip "
        "functions elements are too stiff at an end, and their answer is that of a shorter cut "
        "than they realise: conforming ones by 0.38 ± 0.13 elements at every end, XFEM by as much "
        "as the last column says less the second. The last column is expected, not measured."
    )
    table = tag("table", tag("thead", head), tag("tbody", rows), class_="map")
    return joined(tag("p", said, class_="quiet"), tag("div", table, class_="scroll"))


def _signed(said: str) -> str:
    return said.replace("-", "−")


def _bars(budget: Mapping[str, Any]) -> Markup:
    parts = [*budget["parts"], budget["total"]]
    ends = [p["value"] + s * p["uncertainty"] for p in parts for s in (-1, 1)]
    low, high = min(0.0, *ends), max(0.0, *ends)
    length = (high - low) or 1.0
    x0, x1 = _LEFT, WIDTH - _RIGHT
    height = _TOP + _ROW * len(parts) + 8

    def x(value: float) -> float:
        return x0 + (value - low) / length * (x1 - x0)

    title = metric_title(budget["metric"])
    title = title if title.startswith("relative") else f"{title}, relative"
    content = [text(2, 12, title, class_="axis")]
    for row, part in enumerate(parts):
        y = _TOP + _ROW * row
        colour = _TOTAL if row == len(parts) - 1 else _COLOUR
        left, right = sorted((x(0.0), x(part["value"])))
        size = {"x": f"{left:.1f}", "y": f"{y:.1f}", "height": f"{_ROW - 12}"}
        content.append(tag("rect", width=f"{max(right - left, 0.5):.1f}", fill=colour, **size))
        middle = y + (_ROW - 12) / 2
        first, last = (x(part["value"] + s * part["uncertainty"]) for s in (-1, 1))
        whisker = f"M{first:.1f} {middle - 4:.1f}v8m0 -4H{last:.1f}m0 -4v8"
        content.append(tag("path", d=whisker, class_="bar", stroke="#1b1b1b"))
        content.append(text(x0 - 8, middle + 4, part["source"], text_anchor="end", class_="note"))
        beyond = max(right, first, last) + 5
        said = "round-off" if part.get("round_off") else _signed(f"{100 * part['value']:.3g} %")
        content.append(text(beyond, middle + 4, said, class_="note"))
    content.append(tag("path", d=f"M{x(0.0):.1f} {_TOP - 6}V{height - 8}", class_="frame"))
    label = f"{budget['metric']}: " + "; ".join(f"{p['source']} {p['value']:.3g}" for p in parts)
    return tag("svg", tag("title", label), *content, viewBox=f"0 0 {WIDTH} {height}",
               class_="panel", role="img", aria_label=label)  # fmt: skip


def _candidates(record: Mapping[str, Any]) -> Markup:
    listed = record["candidates"]
    chosen = any(one["choices"] for one in listed)  # at rest only the kinematics differ
    titles = ["kinematics", *(["model"] if chosen else []), "level", "h, m", "unknowns", "error",
              "between", "time, ms"]  # fmt: skip
    head = tag("tr", [tag("th", title, scope="col") for title in titles])
    rows = []
    for one in listed:
        cells = [one["choices"]] if chosen else []
        cells.append(str(one["level"]))
        if one["reason"]:
            cells += [one["reason"], "", "", "", ""]
        else:
            enough = one["high"] is not None and one["high"] <= record["tolerance"]
            times = f"{1e3 * one['seconds']:.3g} ({1e3 * one['fastest']:.3g} to "
            cells += [
                f"{one['size']:.3g}",
                str(one["unknowns"]),
                tag("b", number(one["error"])) if enough else number(one["error"]),
                f"{one['low']:.3g} to {one['high']:.3g}",
                f"{times}{1e3 * one['slowest']:.3g})",
            ]
        rows.append(tag("tr", tag("th", one["kinematics"], scope="row"),
                        [tag("td", cell) for cell in cells]))  # fmt: skip
    return tag("table", tag("thead", head), tag("tbody", rows), class_="map")

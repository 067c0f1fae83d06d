"""The page of a study: findings as sentences, then maps and curves, then where it comes from."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json
from verify.printable import shown
from verify.report.budget_figures import budget_section
from verify.report.calibration_figures import calibration_section
from verify.report.cost_study_figures import cost_section
from verify.report.markup import Markup, joined, tag
from verify.report.notation import number
from verify.report.sliver_figures import sliver_curves, sliver_maps
from verify.report.stability_map import MAP_STYLE
from verify.report.summary import badge
from verify.report.thesis_figures import thesis_section
from verify.report.time_panel import time_panel
from verify.result import Verdict
from verify.whole_files import write_whole

__all__ = ["render_study"]

_SCHEMA = 1
_ACCOUNT = ("mechanical", "kinetic", "strain", "algorithmic")
_TITLES = {
    "slivers": "What slivers do",
    "energy": "Whether energy and momenta are kept",
    "cost": "What accuracy costs while a cut grows",
    "budget": "Where the error comes from, and the cheapest adequate model",
    "thesis": "The tables and claims of the thesis, measured again",
    "calibration": "Whether the reference's error bars can be trusted",
}


def render_study(directory: Path, kind: str) -> Path:
    """Write ``<kind>.html`` from ``<kind>.json``; nothing is computed again.

    Raises
    ------
    InputError
        If the record is not there, is no record of this kind, or has another schema version.
    """
    source = directory / f"{kind}.json"
    if not source.exists():
        raise InputError(f"no {kind}.json: the {kind} study has not run", str(directory))
    record = read_json(source)
    expected = {"schema": _SCHEMA, "kind": f"{kind} study"}
    for key, value in expected.items():
        if (found := record.get(key)) != value:
            raise InputError(f"{key} is {shown(found)}; expected {value!r}", str(source))
    target = directory / f"{kind}.html"
    write_whole(target, _page(record, kind))
    return target


def _page(record: Mapping[str, Any], kind: str) -> Markup:
    style = files("verify.report").joinpath("style.css").read_text(encoding="utf-8")
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", _TITLES[kind]),
        tag("style", Markup(style + MAP_STYLE)),
    )
    sections = {
        "slivers": _slivers,
        "energy": _energy,
        "cost": cost_section,
        "budget": budget_section,
        "thesis": thesis_section,
        "calibration": calibration_section,
    }
    body = sections[kind](record)
    shortened = tag(
        "p", "Note: quick: fewer sizes and shorter runs than the whole study.", class_="warning"
    )
    top = tag("header", tag("h1", _TITLES[kind]), class_="top")
    main = tag(
        "main", shortened if record.get("quick") else None, _findings(record), body, _origin(record)
    )
    return joined(Markup("<!DOCTYPE html>\n"), tag("html", head, tag("body", top, main), lang="en"))


def _findings(record: Mapping[str, Any]) -> Markup:
    rows = [
        tag(
            "tr",
            tag("td", tag("b", f["topic"]), tag("div", f["sentence"])),
            tag("td", f["expected"]),
            tag("td", badge(Verdict(f["verdict"])) if f["verdict"] else "–"),
        )
        for f in record["findings"]
    ]
    head = tag("tr", [tag("th", t, scope="col") for t in ("finding", "expected", "verdict")])
    return tag(
        "section",
        tag("h2", "Findings"),
        tag(
            "p",
            "FAIL means that a method does not keep the limit stated beside it, which for some is "
            "the known result; the numbers are those of this run.",
            class_="quiet",
        ),
        tag("div", tag("table", tag("thead", head), tag("tbody", rows), class_="verdicts prose"),
            class_="scroll", tabindex="0", role="region", aria_label="Findings"),
    )  # fmt: skip


def _slivers(record: Mapping[str, Any]) -> Markup:
    return joined(
        [
            tag(
                "section",
                tag("h2", f"{dimension}D"),
                sliver_maps(record["measurements"], dimension),
                tag("h3", "Against the size"),
                tag(
                    "p",
                    "Exponents are fitted from ε = 1e-3 down; ε = 0 is in the maps only. What "
                    "could not be measured, with its reason, is in the record and the table file.",
                    class_="quiet",
                ),
                sliver_curves(record["measurements"], record["growths"], dimension),
            )
            for dimension in record["dimensions"]
        ]
    )


def _energy(record: Mapping[str, Any]) -> Markup:
    offsets = list(dict.fromkeys(g["offset"] for g in record["gravity"]))
    value = {(g["lumping"], g["offset"]): g["value"] for g in record["gravity"]}
    rows = [
        tag("tr", tag("th", lumping, scope="row"),
            [tag("td", number(value[lumping, o])) for o in offsets])
        for lumping in dict.fromkeys(g["lumping"] for g in record["gravity"])
    ]  # fmt: skip
    head = tag("tr", tag("th", "ε ="), [tag("th", f"{o:g}", scope="col") for o in offsets])
    falls = tag(
        "table",
        tag("caption", "Acceleration of the freed half in m/s²; it should be −9.8"),
        tag("thead", head),
        tag("tbody", rows),
        class_="map",
    )
    figures = []
    for one in record["spins"]:
        curves = one["curves"]
        shown = [(name, _changes(curves[name])) for name in _ACCOUNT]
        cuts = [jump["time"] for jump in one["jumps"]]
        note = f" Ended early: {one['failure']}." if one["failure"] else ""
        figures.append(
            tag("figure",
                time_panel(f"{one['scheme']}: change of energy, J", curves["time"], shown, cuts),
                tag("figcaption", f"Step {one['step']:.3g} s.{note}"))
        )  # fmt: skip
    return joined(
        tag("section", tag("h2", "Freed half"), tag("div", falls, class_="scroll")),
        tag(
            "section",
            tag("h2", "Vibrating, spinning, cut twice"),
            tag("p", "Changes since the start; mechanical is kinetic and strain energy together. "
                "Dashed vertical lines are cuts. Algorithmic is what the scheme itself has "
                "dissipated (negative: produced).", class_="quiet"),
            tag("div", figures, class_="panels"),
        ),
    )  # fmt: skip


def _changes(values: list[float | None]) -> list[float]:
    known = [float("nan") if value is None else value for value in values]
    return [value - known[0] for value in known]


def _origin(record: Mapping[str, Any]) -> Markup:
    origin = dict(record.get("provenance") or {})
    versions = origin.pop("versions", {})
    said = [("command", record.get("command")), ("seconds", f"{record['seconds']:.1f}")]
    said += origin.items()
    said.append(("versions", ", ".join(f"{name} {v}" for name, v in versions.items())))
    entries = [joined(tag("dt", key), tag("dd", str(value))) for key, value in said]
    return tag("section", tag("h2", "Provenance"), tag("dl", entries, class_="record"))

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
from verify.report.markup import Markup, badge, joined, tag
from verify.report.notation import metric_title, number
from verify.report.sliver_figures import sliver_curves, sliver_maps
from verify.report.stability_map import MAP_STYLE, listed
from verify.report.thesis_figures import thesis_section
from verify.result import Verdict
from verify.whole_files import write_whole

__all__ = ["render_study"]

_SCHEMA = 1
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
    style = files("verify.report").joinpath("templates", "style.css").read_text(encoding="utf-8")
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
    families = list(dict.fromkeys(m["family"] for m in record["measurements"]))
    return joined(
        [
            tag(
                "section",
                tag("h2", family),
                sliver_maps(listed(record["measurements"], family=family)),
                tag(
                    "p",
                    "Exponents are fitted from ε = 1e-3 down; ε = 0 is in the maps and the table "
                    "file. What could not be measured is there too, with its reason.",
                    class_="quiet",
                ),
                sliver_curves(
                    listed(record["measurements"], family=family),
                    listed(record["growths"], family=family),
                ),
            )
            for family in families
        ]
    )


def _energy(record: Mapping[str, Any]) -> Markup:
    sections = []
    for family in dict.fromkeys(m["family"] for m in record["measurements"]):
        own = listed(record["measurements"], family=family)
        names = list(dict.fromkeys(m["quantity"] for m in own if m["unit"] == "" and m["value"]))
        rows = []
        for solver, size in dict.fromkeys((m["solver"], m["size"]) for m in own):
            mine = listed(own, solver=solver, size=size)
            value = {m["quantity"]: m["value"] for m in mine}
            row = "" if size is None else f", {size:g}"
            cells = [tag("td", number(value.get(name)), class_="number") for name in names]
            rows.append(tag("tr", tag("th", f"{solver}{row}", scope="row"), cells))
        heads = [metric_title(name) for name in names]
        head = tag("tr", [tag("th", text, scope="col") for text in ("solver", *heads)])
        table = tag("table", tag("thead", head), tag("tbody", rows))
        scrolled = tag(
            "div", table, class_="scroll", tabindex="0", role="region", aria_label=family
        )
        sections.append(tag("section", tag("h2", family), scrolled))
    return joined(sections)


def _origin(record: Mapping[str, Any]) -> Markup:
    origin = dict(record.get("provenance") or {})
    versions = origin.pop("versions", {})
    said = [("command", record.get("command")), ("seconds", f"{record['seconds']:.1f}")]
    said += origin.items()
    said.append(("versions", ", ".join(f"{name} {v}" for name, v in versions.items())))
    entries = [joined(tag("dt", key), tag("dd", str(value))) for key, value in said]
    return tag("section", tag("h2", "Provenance"), tag("dl", entries, class_="record"))

"""The end of the report: how to read it, and where its numbers come from."""

from typing import Any

from verify.report.markup import Markup, joined, tag
from verify.report.notation import bytes_text
from verify.report.run_directory import Run

__all__ = ["origin_section", "reading_guide"]

_GUIDE = (
    (
        "Verdicts",
        "PASS: the whole interval in which the true value lies satisfies the limit. FAIL: the "
        "whole interval violates it. UNDECIDED: the limit lies inside the interval, so the "
        "reference is too uncertain to tell. ERROR: a solve that is needed did not finish.",
    ),
    (
        "Intervals",
        "Observed values carry the interval that the imperfection of the reference and of the "
        "numerical integration in the comparison put around them. No interval means that it "
        "is smaller than the digits shown.",
    ),
    (
        "Convergence",
        "Both axes are logarithmic. An order is fitted to the finest levels and is stated only "
        "where it means something; otherwise its reason stands there. Inside the grey band an "
        "error cannot be told from that of the comparison: of the reference, and of the "
        "numerical integration that measures the difference.",
    ),
    (
        "Cost",
        "Lower and further left is better. Times are wall times on the machine named below, with "
        "compilation and the first call left out; compare their ratios inside one figure, not "
        "the seconds between machines. Meshing is drawn apart, as not every use pays it.",
    ),
    (
        "Pictures",
        "All bodies of a case share view, colour scale and enlargement. The error is that of the "
        "displacement, as a length.",
    ),
    (
        "Files",
        "The same numbers lie beside this page in results.json, results.csv and junit.xml.",
    ),
)


def reading_guide() -> Markup:
    """Return how to read the report."""
    entries = [joined(tag("dt", title), tag("dd", words)) for title, words in _GUIDE]
    return tag("section", tag("h2", "How to read this"), tag("dl", entries), id="reading")


def origin_section(run: Run) -> Markup:
    """Return the provenance of the run."""
    record = run.record
    origin = record.get("provenance")
    origin = dict(origin) if isinstance(origin, dict) else {}
    versions = origin.pop("versions", None)
    commit, dirty = origin.pop("commit", None), origin.pop("dirty", None)
    state = {True: ", with changes that are not committed", False: ", unchanged"}.get(dirty, "")
    said: list[tuple[str, Any]] = [
        ("command", tag("code", record.get("command") or "unknown")),
        ("started", record.get("started") or "unknown"),
        ("finished", record.get("finished") or "not finished"),
        ("commit", joined(tag("code", commit), state) if commit else "unknown"),
    ]
    if isinstance(memory := origin.pop("memory", None), int | float):
        said.append(("memory", bytes_text(memory)))
    said += [(key, str(value)) for key, value in origin.items()]
    if isinstance(versions, dict):
        said.append(("versions", ", ".join(f"{name} {v}" for name, v in versions.items())))
    if isinstance(options := record.get("options"), dict):
        written = ", ".join(f"{key} {value}" for key, value in options.items() if value is not None)
        said.append(("options", written))
    entries = [joined(tag("dt", key), tag("dd", value)) for key, value in said]
    return tag(
        "section",
        tag("h2", "Provenance"),
        tag("dl", entries, class_="record"),
        id="provenance",
    )

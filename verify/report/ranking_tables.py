"""The rankings of a run as tables: one per question, and what was left out."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.blocks import Cell, Table, plain_table
from verify.report.notation import metric_title, number, solver_title, with_interval

_STATES = ("pass", "fail", "error", "refused")
_ENDS = (
    ("failed", "failed"),
    ("timeout", "out of time"),
    ("memory", "out of memory"),
    ("blown_up", "blown up"),
    ("inside_out", "with elements inside out"),
)


def conformance_table(ranking: Mapping[str, Any]) -> Table | None:
    """Return how many conformance checks each solver passes; None if nobody was asked."""
    found = ranking["conformance"]
    if not any(own.get("checks") for own in found.values()):
        return None
    rows = []
    for solver in ranking["solvers"]:
        own = found.get(solver, {})
        checks = own.get("checks")
        if checks is None:
            rows.append([solver_title(solver), "–", "–", "–", own.get("unchecked", "not checked")])
            continue
        named = {state: [c for c in checks if c["state"] == state] for state in _STATES}
        bad = [
            f"{c['name']}: {c['claim']}" + (f" ({c['reason']})" if c["reason"] else "")
            for c in (*named["fail"], *named["error"])
        ]
        counts = [len(named[state]) for state in _STATES]
        rows.append([solver_title(solver), str(counts[0]), str(counts[1] + counts[2]),
                     str(counts[3]), "; ".join(bad) or "–"])  # fmt: skip
    head = ["solver", "passed", "failed", "refused", "what fails"]
    return plain_table("Conformance: claims that hold for every right solver", head, rows, "prose")


def compared(ranking: Mapping[str, Any], question: str, title: str) -> list[Table]:
    """Return the table of a question, a row per solver, and that of what was left out."""
    comparisons = _merged(ranking[question])
    shown = [one for one in comparisons if one["standings"]]
    tables = []
    if shown:
        first = [s["solver"] for s in shown[0]["standings"]]
        order = first + [solver for solver in ranking["solvers"] if solver not in first]
        rows = [[_marked(s, ranking), *(_standing(one, s) for one in shown)] for s in order]
        head = [Cell("solver"), *(_column(one) for one in shown)]
        tables.append(Table(f"{title}: rank, number [interval]", head, rows))
    if rest := _grouped(comparisons):
        head_ = ["case", "solver", "metric", "not in the numbers because"]
        tables.append(plain_table(f"{title}: left out", head_, rest, "prose"))
    return tables


def stability_table(ranking: Mapping[str, Any]) -> Table:
    """Return how the solves of each solver ended."""
    rows: list[list[str | Cell]] = []
    for own in ranking["stability"]:
        ended = [f"{own[name]} {word}" for name, word in _ENDS if own[name]]
        done = [f"{kind}: {number(count)}" for kind, count in own["regularisations"].items()]
        rows.append(
            [_marked(own["solver"], ranking), Cell(_rank(own), strong=True),
             f"{own['solved']} of {own['asked']}", str(own["refused"]), ", ".join(ended) or "–",
             "; ".join(done) or "–"]
        )  # fmt: skip
    head = ["solver", "rank", "solved", "refused", "lost or suspect", "regularised, how often"]
    return plain_table("Robustness", head, rows, "prose")


def left_out_table(ranking: Mapping[str, Any]) -> Table | None:
    """Return what is in no ranking."""
    rows = [
        [e["case"], solver_title(e["solver"]) if e["solver"] else "all", e["reason"]]
        for e in ranking["left_out"]
    ]
    caption = "In no ranking: solves without an answer, undecided checks"
    return (
        plain_table(caption, ["case", "solver", "what happened"], rows, "prose") if rows else None
    )


def _marked(solver: str, ranking: Mapping[str, Any]) -> Cell:
    """Return a solver's name, with a mark if it fails a conformance check."""
    checks = ranking["conformance"].get(solver, {}).get("checks") or []
    wrong = any(c["state"] in ("fail", "error") for c in checks)
    mark, tip = ("†", "does not conform") if wrong else ("", "")
    return Cell(solver_title(solver), mark=mark, tip=tip)


def _merged(comparisons: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Show two views of a metric as one where they are the same numbers."""
    merged: list[dict[str, Any]] = []
    for one in comparisons:
        before = merged[-1] if merged else None
        same = before is not None and before["metric"] == one["metric"] and one["standings"]
        if same and before is not None and before["standings"] == one["standings"]:
            before["view"] = f"{before['view']}, {one['view']}"
            before["left_out"] = one["left_out"]
        else:
            merged.append(dict(one))
    return merged


def _column(one: Mapping[str, Any]) -> Cell:
    quantities = one["metric"] == "quantities"
    name = "quantities of interest" if quantities else metric_title(one["metric"])
    return Cell(name, one["view"])


def _standing(one: Mapping[str, Any], solver: str) -> Cell:
    own = next((s for s in one["standings"] if s["solver"] == solver), None)
    if own is None or own["value"] is None:
        return Cell("–")
    few = f"{own['count']} of {one['items']}" if own["count"] < one["items"] else ""
    note = few + (f" ({own['where']})" if own["where"] else "")
    value = with_interval(own["value"], own["low"], own["high"])
    return Cell(f"{_rank(own)}: {value}", note)


def _rank(own: Mapping[str, Any]) -> str:
    return "–" if own["rank"] is None else f"{own['rank']}{'=' if own['tied'] else ''}"


def _grouped(comparisons: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """List what was left out, a reason that holds for several metrics once."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for one in comparisons:
        for entry in one["left_out"]:
            key = (entry["case"], entry["solver"], entry["reason"])
            rows.setdefault(key, []).append(metric_title(one["metric"]))
    return [
        [case, solver_title(solver) if solver else "all", ", ".join(dict.fromkeys(metrics)), reason]
        for (case, solver, reason), metrics in rows.items()
    ]

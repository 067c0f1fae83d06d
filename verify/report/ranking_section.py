"""The section that answers which solver: a table per question, and what was left out."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.markup import Markup, joined, tag
from verify.report.notation import metric_title, number, solver_title, with_interval
from verify.report.tables import table

__all__ = ["ranking_section"]

_ONE_CASE = "Rankings over one case say nothing about another."
_MEAN = (
    "Each number is the geometric mean, over cases, of the ratio to the best solver of the case; "
    "1 is the best."
)
_HOW = {
    "accuracy": f"Who is nearest to the truth? {_MEAN} The interval is what the uncertainty of "
    "the reference leaves open, and overlapping intervals are a tie (=). It does not contain how "
    "an error changes when the mesh is moved a little: a few per cent are no difference. Where a "
    "solver is exact to round-off there is no ratio: the largest error of each over those cases "
    "counts, and all at round-off are first.",
    "energy": "Who keeps energy and momentum where things move? The worst case counts, on the "
    "finest level.",
    "cost": f"Who is cheapest at equal error? {_MEAN} Times are interpolated between levels at the "
    "smallest error that most solvers reach; meshing counts where each new cut needs a new mesh. "
    "The interval spans the repetitions.",
}


def ranking_section(ranking: Mapping[str, Any] | None) -> Markup | None:
    """Return the section, or None for a run of one solver or from before there were rankings."""
    if not ranking or len(ranking.get("solvers", [])) < 2:
        return None
    cases = len(ranking["cases"])
    parts: list[Markup | None] = [
        tag("p", f"{len(ranking['solvers'])} solvers on {cases} case{'s' * (cases != 1)}. "
            "A solver without a number in some case has no rank (–): its number rests on other "
            f"cases than the rest, how many stands beside it. {_ONE_CASE}"),
        _conformance(ranking),
        *_compared(ranking, "accuracy", "Accuracy"),
        *_stability(ranking),
        *_compared(ranking, "energy", "Energy"),
        *_compared(ranking, "cost", "Cost"),
        _left_out(ranking),
    ]  # fmt: skip
    return tag("section", tag("h2", "Which solver"), *parts, id="which")


def _conformance(ranking: Mapping[str, Any]) -> Markup | None:
    found = ranking["conformance"]
    if not any(own.get("checks") for own in found.values()):
        said = "No conformance suite was run before this ranking (verify run --conform)."
        return tag("p", said, class_="warning")
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
            for c in (*named["broken"], *named["failed"])
        ]
        counts = [len(named[state]) for state in _STATES]
        rows.append(
            [solver_title(solver), counts[0], counts[1] + counts[2], counts[3],
             [tag("div", words) for words in bad] or "–"]
        )  # fmt: skip
    head = ["solver", "kept", "broken or failed", "refused", "what it does not keep"]
    return table(head, rows, "Conformance: what every right solver keeps", class_="prose")


_STATES = ("kept", "broken", "failed", "refused")


def _mark(solver: str, ranking: Mapping[str, Any]) -> Markup:
    """Return a solver's name, with a mark if it breaks what every right solver keeps."""
    checks = ranking["conformance"].get(solver, {}).get("checks") or []
    broken = any(c["state"] in ("broken", "failed") for c in checks)
    return joined(
        solver_title(solver), tag("abbr", "†", title="does not conform") if broken else ""
    )


def _compared(ranking: Mapping[str, Any], question: str, title: str) -> list[Markup]:
    """Return one table of a question: a row per solver, a column per metric and view."""
    comparisons = _merged(ranking[question])
    if not comparisons:
        return []
    shown = [one for one in comparisons if one["standings"]]
    parts = [tag("h3", title), tag("p", _HOW[question], class_="quiet")]
    if question == "cost" and ranking.get("contended"):
        parts.append(tag("p", f"Timing note: {'; '.join(ranking['contended'])}.", class_="warning"))
    if shown:
        head = ["solver", *(_column(one) for one in shown)]
        rows = [
            [_mark(solver, ranking), *(_standing(one, solver) for one in shown)]
            for solver in _order(shown, ranking["solvers"])
        ]
        parts.append(table(head, rows, f"{title}: rank, number [interval]"))
    if rest := _grouped(comparisons):
        parts.append(table(["case", "solver", "metric", "not in the numbers because"], rest,
                           f"{title}: left out", class_="prose"))  # fmt: skip
    return parts


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


def _column(one: Mapping[str, Any]) -> Markup:
    name = (
        "quantities of interest" if one["metric"] == "quantities" else metric_title(one["metric"])
    )
    view = one["view"]
    return joined(name, tag("div", view, class_="quiet"))


def _standing(one: Mapping[str, Any], solver: str) -> Markup:
    own = next((s for s in one["standings"] if s["solver"] == solver), None)
    if own is None or own["value"] is None:
        return joined("–")
    rank = "–" if own["rank"] is None else f"{own['rank']}{'=' if own['tied'] else ''}"
    where = f" ({own['where']})" if own["where"] else ""
    few = f"{own['count']} of {one['items']}" if own["count"] < one["items"] else ""
    said = ", ".join(words for words in (few,) if words)
    return joined(
        tag("b", rank), " ", with_interval(own["value"], own["low"], own["high"]),
        tag("div", said + where, class_="quiet") if said or where else None,
    )  # fmt: skip


def _order(shown: Sequence[Mapping[str, Any]], solvers: Sequence[str]) -> list[str]:
    """Order the rows by the first column."""
    first = [s["solver"] for s in shown[0]["standings"]]
    return first + [solver for solver in solvers if solver not in first]


def _grouped(comparisons: Sequence[Mapping[str, Any]]) -> list[list[Any]]:
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


def _stability(ranking: Mapping[str, Any]) -> list[Markup]:
    rows = []
    for own in ranking["stability"]:
        ended = [f"{own[name]} {word}" for name, word in _ENDS if own[name]]
        done = [f"{kind}: {number(count)}" for kind, count in own["regularisations"].items()]
        rank = "–" if own["rank"] is None else f"{own['rank']}{'=' if own['tied'] else ''}"
        rows.append(
            [_mark(own["solver"], ranking), tag("b", rank), f"{own['solved']} of {own['asked']}",
             own["refused"], ", ".join(ended) or "–", "; ".join(done) or "–"]
        )  # fmt: skip
    head = ["solver", "rank", "solved", "refused", "lost or suspect", "regularised, how often"]
    return [
        tag("h3", "Stability"),
        tag("p", "Who gets there at all? Ranked by the share of solves that failed, ran out of "
            "time or memory, or blew up (as far off as a body that does not move). A refusal is "
            "not held against a solver: it says what it cannot do.", class_="quiet"),
        table(head, rows, "Stability", class_="prose"),
    ]  # fmt: skip


_ENDS = (
    ("failed", "failed"),
    ("timeout", "out of time"),
    ("memory", "out of memory"),
    ("blown_up", "blown up"),
    ("inside_out", "with elements inside out"),
)


def _left_out(ranking: Mapping[str, Any]) -> Markup:
    rows = [
        [e["case"], solver_title(e["solver"]) if e["solver"] else "all", e["reason"]]
        for e in ranking["left_out"]
    ]  # fmt: skip
    if not rows:
        return tag("p", "No solve is missing, and every check of the cases was decided.")
    head = ["case", "solver", "what happened"]
    return table(head, rows, "In no ranking: solves without an answer, undecided checks",
                 class_="prose")  # fmt: skip

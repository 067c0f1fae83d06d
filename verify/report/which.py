"""Which solver: ratios, wins and coverage per kind of scene and metric, times, and energy."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.answers import BASELINE
from verify.report.evidence import MISSING, misses_material
from verify.report.notation import Cell, Table, metric_title, number, solver_title, with_interval
from verify.result import CaseResult

_KINDS = {"rest": "at rest", "motion": "in motion"}
_TITLES = {
    "displacement_l2": "Relative L² error of the displacement",
    "energy_norm": "Relative energy-norm error",
    "jump_l2": "Relative L² error of the jump across the cut",
    "quantities": "Relative errors of the quantities of interest",
    "time": "Time of a cut at an equal L² error of the displacement",
}


def which_view(
    ranking: dict[str, Any] | None, results: Sequence[CaseResult] = ()
) -> dict[str, Any] | None:
    """Return a ranking with its tables; None for a run of one solver, or without a ranking.

    By the results of its cases, solvers that miss a part of a body are marked.
    """
    if not ranking or len(ranking["solvers"]) < 2:
        return None
    beside = baseline(ranking)
    missing = {name for name in ranking["solvers"] if misses_material(results, name)}
    asked = {kind: max(own[kind][1] for own in ranking["coverage"].values()) for kind in _KINDS}
    scenes = [
        f"{count} scene{'s' * (count != 1)} {_KINDS[k]}" for k, count in asked.items() if count
    ]
    return {
        **ranking,
        "scenes": " and ".join(scenes) or "no scene",
        "beside": solver_title(beside),
        "errors": [t for m in _TITLES if m != "time" for t in _tables(ranking, m, beside, missing)],
        "times": _tables(ranking, "time", beside, missing),
        "energy_tables": _energy(ranking),
    }


def baseline(ranking: Mapping[str, Any]) -> str:
    """Return the solver that ratios are to: `conforming`, else the first that answered most."""
    solvers: Sequence[str] = ranking["solvers"]
    return BASELINE if BASELINE in solvers else max(solvers, key=lambda s: _answered(ranking, s))


def _answered(ranking: Mapping[str, Any], solver: str) -> int:
    return sum(answered for answered, _ in ranking["coverage"][solver].values())


def _tables(ranking: Mapping[str, Any], metric: str, beside: str, missing: set[str]) -> list[Table]:
    """Return a table for each kind of scene in which two solvers have the metric."""
    # programs of one discretisation share their errors, but not their times
    groups = [] if metric == "time" else ranking["groups"]
    alone = [[s] for s in ranking["solvers"] if not any(s in group for group in groups)]
    rows = [sorted(own, key=lambda s: (s != beside, -_answered(ranking, s)))
            for own in (*groups, *alone)]  # fmt: skip
    found = []
    for kind, words in _KINDS.items():
        pairs = {(p["solver"], p["rival"]): p for p in ranking["pairs"]
                 if (p["metric"], p["kind"]) == (metric, kind)}  # fmt: skip
        if not pairs:
            continue
        leads = [members[0] for members in rows]
        order = sorted(rows, key=lambda members: _place(pairs.get((members[0], beside)),
                                                        beside in members))  # fmt: skip
        head = [
            "solver", Cell(f"ratio to {solver_title(beside)}", "median (range)"),
            Cell("won, tied, lost", "against each other row"),
            Cell("answered", "scenes of those asked"),
        ]  # fmt: skip
        body = [
            [
                _named(members, missing),
                _ratio(pairs.get((members[0], beside)), beside in members),
                _won([pairs.get((members[0], rival)) for rival in leads]),
                _coverage(ranking, members, kind),
            ]
            for members in order
        ]
        caption = f"{_TITLES[metric]}, scenes {words}"
        found.append(Table(caption, head, body, "pairs", named=True))
    return found


def _named(members: Sequence[str], missing: set[str]) -> Cell:
    """Name the members of a row, and say if their numbers are of a smaller body."""
    gone = bool(missing.intersection(members))
    names = ", ".join(map(solver_title, members))
    return Cell(names + MISSING * gone, "a part of the body is missing" if gone else "")


def _place(pair: Mapping[str, Any] | None, is_beside: bool) -> tuple[bool, float]:
    ratio = 1.0 if is_beside else pair and pair["ratio"]
    return ratio is None, ratio or 0.0


def _ratio(pair: Mapping[str, Any] | None, is_beside: bool) -> Cell:
    if is_beside:
        return Cell("1")
    if pair is None:
        return Cell("–", "no scene in common")
    if pair["ratio"] is None:
        return Cell("–", "exact, or not told from none")
    middle, low, high = (number(pair[key], 3) for key in ("ratio", "low", "high"))
    count = pair["count"]
    if count == 1:
        return Cell(middle, "1 scene")
    return Cell(f"{middle} ({low}–{high})", f"{count} scenes")


def _won(pairs: Sequence[Mapping[str, Any] | None]) -> Cell:
    sums = [sum(p[key] for p in pairs if p) for key in ("wins", "ties", "losses")]
    return Cell(", ".join(map(str, sums)) if any(sums) else "–")


def _coverage(ranking: Mapping[str, Any], members: Sequence[str], kind: str) -> Cell:
    counts = {name: ranking["coverage"][name][kind] for name in members}
    shown = [f"{answered} of {asked}" for answered, asked in counts.values()]
    rest = zip(members[1:], shown[1:], strict=True)
    others = "; ".join(f"{solver_title(name)} {own}" for name, own in rest if own != shown[0])
    return Cell(shown[0], others)


def _energy(ranking: Mapping[str, Any]) -> list[Table]:
    """Return a row for each solver, and what was left out."""
    tables, compared = [], ranking["energy"]
    if compared:
        order = dict.fromkeys([s["solver"] for s in compared[0]["standings"]] + ranking["solvers"])
        rows = [[solver_title(s), *(_standing(one, s) for one in compared)] for s in order]
        head = ["solver", *(metric_title(one["metric"]) for one in compared)]
        tables.append(Table("Energy: rank, number [interval]", head, rows))
    rest: dict[tuple[str, str, str], list[str]] = {}
    for one in compared:
        for e in one["left_out"]:
            key = e["case"], solver_title(e["solver"]), e["reason"]
            rest.setdefault(key, []).append(metric_title(one["metric"]))
    if rest:
        rows = [[case, who, ", ".join(metrics), why] for (case, who, why), metrics in rest.items()]
        head = ["case", "solver", "metric", "not in the numbers because"]
        tables.append(Table("Energy: left out", head, rows, "prose"))
    return tables


def _standing(one: Mapping[str, Any], solver: str) -> Cell:
    own = next((s for s in one["standings"] if s["solver"] == solver), None)
    if own is None or own["value"] is None:
        return Cell("–")
    few = f"{own['count']} of {one['items']}" if own["count"] < one["items"] else ""
    note = f"{few} ({own['where']})".strip()
    return Cell(f"{rank(own)}: {with_interval(own['value'], own['low'], own['high'])}", note)


def rank(own: Mapping[str, Any]) -> str:
    """Return the rank of a standing, with a sign if it is shared."""
    return "–" if own["rank"] is None else f"{own['rank']}{'=' if own['tied'] else ''}"

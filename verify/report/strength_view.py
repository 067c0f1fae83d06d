"""A sentence for every solver on what it is best at, with the row that it rests on."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.blocks import Table, plain_table
from verify.report.notation import number, solver_title

_TIME = "time at equal error"
_WORDS = {
    "displacement_l2": "L² error",
    "energy_norm": "energy-norm error",
    "jump_l2": "L² error of the jump",
    _TIME: "time at equal L² error",
}
_HEADS = ["solver", "best at", "clearest of these cases", "within 5 % of the best, cases"]


def strengths_table(ranking: Mapping[str, Any]) -> Table | None:
    """Return a row per solver; None for a ranking from before there were such."""
    found = ranking.get("strengths") or []
    if not found:
        return None
    rows = []
    for solver in ranking["solvers"]:
        own = [one for one in found if one["solver"] == solver]
        rows.append([solver_title(solver), _sentence(own), _row(own), _near(own)])
    return plain_table("What each solver is best at", _HEADS, rows, "prose")


def _order(one: Mapping[str, Any]) -> tuple[float, float]:
    return one["alone"] / one["items"], one["best"] / one["items"]


def _sentence(own: Sequence[Mapping[str, Any]]) -> str:
    if not own:
        return "No case in which it and another have a number to compare."
    good = [one for one in own if one["best"]]
    if not good:
        return "Best at nothing here: in every case another is certainly better."
    said = [
        f"{_WORDS[one['question']]} ({one['best']} of {one['items']} cases"
        + (f", alone in {one['alone']})" if one["alone"] else ")")
        for one in sorted(good, key=_order, reverse=True)
    ]
    never = [_WORDS[one["question"]] for one in own if not one["best"]]
    rest = f" Never in {', '.join(never)}." if never else ""
    return f"Nobody is better in {', '.join(said)}.{rest}"


def _row(own: Sequence[Mapping[str, Any]]) -> str:
    clear = [one for one in own if one["case"]]
    if not clear:
        return "–"
    one = max(clear, key=_order)
    return (
        f"{one['case']}: {_WORDS[one['question']]} {_written(one, one['value'])}, next "
        f"{solver_title(one['next_solver'])} with {_written(one, one['next_value'])}"
    )


def _near(own: Sequence[Mapping[str, Any]]) -> str:
    said = [f"{_WORDS[one['question']]} {one['near']} of {one['items']}" for one in own]
    return "; ".join(said) or "–"


def _written(one: Mapping[str, Any], value: float) -> str:
    return f"{number(value, 3)}{' s' if one['question'] == _TIME else ''}"

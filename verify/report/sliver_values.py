"""Numbers of a sliver study by family, solver and ε, as its record holds them."""

from collections.abc import Mapping, Sequence
from typing import Any

Records = Sequence[Mapping[str, Any]]
STEP, UNCUT = "critical explicit step", "critical explicit step, uncut"
LUMPED = f"{UNCUT} and lumped"
SCALED = "condition number scaled by the diagonal"
ITERATIONS = "iterations of conjugate gradients"
FREQUENCY, MEASURE = "lowest natural frequency", "conforming"
UNKNOWNS = "unknowns of the system"
_LUMPS = 1e-6  # by which the steps of one lumped mass differ


def listed(records: Records, **fixed: Any) -> list[Mapping[str, Any]]:
    """Return the records in which all of these keys have these values."""
    return [r for r in records if all(r.get(key) == value for key, value in fixed.items())]


def values_of(measured: Records, family: str, solver: str, quantity: str) -> dict[float, float]:
    """Return the values that are known, by ε."""
    own = listed(measured, family=family, solver=solver, quantity=quantity)
    return {m["size"]: m["value"] for m in own if m["value"] is not None}


def counts_of(measured: Records, family: str, solver: str) -> dict[float, int]:
    """Return the iterations of conjugate gradients, by ε."""
    found = values_of(measured, family, solver, ITERATIONS)
    return {size: round(value) for size, value in found.items()}


def shares_of(
    measured: Records, family: str, solver: str, whole: str = UNCUT
) -> dict[float, float]:
    """Return the share of an uncut step that is left, by ε."""
    uncut = next(iter(values_of(measured, family, solver, whole).values()), None)
    steps = values_of(measured, family, solver, STEP)
    return {size: step / uncut for size, step in steps.items()} if uncut else {}


def ratios_of(
    measured: Records, family: str, solver: str, quantity: str, rival: str = MEASURE
) -> dict[float, float]:
    """Return values over the values of another solver, by ε."""
    own, others = (values_of(measured, family, s, quantity) for s in (solver, rival))
    return {size: value / others[size] for size, value in own.items() if others.get(size)}


def mass_of(measured: Records, solver: str) -> str:
    """Return which mass the uncut body of a solver has; empty if that is not known."""
    own = listed(measured, solver=solver)
    steps = {m["quantity"]: m["value"] for m in own if m["quantity"] in (UNCUT, LUMPED)}
    whole, lumped = steps.get(UNCUT), steps.get(LUMPED)
    if not whole or not lumped:
        return ""
    return "lumped" if abs(whole / lumped - 1.0) <= _LUMPS else "consistent"


def words_of(words: Sequence[str]) -> str:
    """Return a list as a sentence has it: a, b and c."""
    return ", ".join(words[:-1]) + " and " * (len(words) > 1) + words[-1]

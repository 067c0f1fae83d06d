"""The measurements of one dimension: looked up, put into words and judged."""

from collections.abc import Callable, Sequence
from math import nan
from typing import Any

from verify.result import Verdict
from verify.study.slivers.measurement import Measurement
from verify.study.slivers.placements import NEAR_NODES

__all__ = ["FLAT", "Results", "counts", "expects", "exponent_text", "extreme", "span", "worst"]

FLAT = 0.02  # exponents as near as that to zero change a value by 10 % in two decades at most


class Results:
    """The measurements and growths of one dimension."""

    def __init__(
        self, dimension: int, measured: Sequence[Measurement], growths: Sequence[dict[str, Any]]
    ) -> None:
        self.dimension = dimension
        self.measured = [m for m in measured if m.dimension == dimension]
        self._growths = [g for g in growths if g["dimension"] == dimension]

    @property
    def near_nodes(self) -> list[str]:
        """Placements of one cut that comes near to nodes."""
        return sorted({m.placement for m in self.measured} & set(NEAR_NODES))

    def values(self, quantity: str, **fixed: str) -> list[Measurement]:
        """Measurements of a quantity that have a value."""
        return [m for m in self.all_of(quantity, **fixed) if m.value is not None]

    def all_of(self, quantity: str, **fixed: str) -> list[Measurement]:
        """Measurements of a quantity, with or without a value."""
        return [
            m
            for m in self.measured
            if m.quantity == quantity and all(getattr(m, k) == v for k, v in fixed.items())
        ]

    def near(self, quantity: str, **fixed: str) -> list[Measurement]:
        """Measurements of a quantity, with or without a value, of one cut near to nodes."""
        return [m for m in self.all_of(quantity, **fixed) if m.placement in NEAR_NODES]

    def growth(
        self, quantity: str, variant: str = "", treatment: str = "keep",
        placement: str = "along faces",
    ) -> dict[str, Any]:  # fmt: skip
        """Exponent of a series."""
        for g in self._growths:
            if (g["quantity"], g["variant"], g["treatment"], g["placement"]) == (
                quantity, variant, treatment, placement,
            ):  # fmt: skip
                return g
        return {"exponent": None, "uncertainty": 0.0, "reason": "not measured"}

    def uncut(self, quantity: str) -> float:
        """Return a value of the uncut body."""
        (found,) = [m.value for m in self.all_of(quantity, placement="uncut")]
        assert found is not None
        return found


def exponent_text(growth: dict[str, Any]) -> str:
    """Write an exponent with its uncertainty, or why there is none."""
    if growth["exponent"] is None:
        return f"none ({growth['reason']})"
    value = f"{growth['exponent']:.3f}".replace("-", "−").replace("−0.000", "0.000")
    return f"{value} ± {max(growth['uncertainty'], 0.0005):.3f}"


def expects(growth: dict[str, Any], low: float, high: float) -> Verdict:
    """PASS if the exponent's whole interval lies inside [low, high], FAIL if none of it does."""
    if growth["exponent"] is None:
        return Verdict.UNDECIDED
    down = growth["exponent"] - growth["uncertainty"]
    up = growth["exponent"] + growth["uncertainty"]
    if low <= down and up <= high:
        return Verdict.PASS
    return Verdict.FAIL if up < low or down > high else Verdict.UNDECIDED


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Return FAIL if any failed, else UNDECIDED if any is or there are none, else PASS."""
    if not verdicts:
        return Verdict.UNDECIDED
    for verdict in (Verdict.FAIL, Verdict.UNDECIDED):
        if verdict in verdicts:
            return verdict
    return Verdict.PASS


def span(measured: Sequence[Measurement]) -> str:
    """Write the range of the values that are known."""
    known = [m.value for m in measured if m.value is not None]
    return f"between {min(known):.4g} and {max(known):.4g}" if known else "nothing measured"


def extreme(pick: Callable[[Sequence[float]], float], known: Sequence[float]) -> float:
    """Return the least or largest of some values; not a number if there is none."""
    return pick(known) if known else nan


def counts(measured: Sequence[Measurement]) -> str:
    """Write the range of whole numbers."""
    low, high = (f(int(m.value or 0) for m in measured) for f in (min, max))
    return f"{low}" if low == high else f"{low} to {high}"

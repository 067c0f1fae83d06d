"""What the sweep says, in sentences: growth against the table that the theory gives."""

from collections.abc import Callable, Iterator, Sequence
from math import sqrt
from typing import Any

from verify.result import Verdict
from verify.study.finding import Finding
from verify.study.slivers.measurement import Measurement

__all__ = ["findings"]

Wanted = Callable[[Measurement], bool]
_FLAT = 0.02  # exponents as near as that to zero change a value by 10 % in two decades at most
_VANISHING = ("consistent", "row sum", "HRZ")


class _Results:
    """The measurements and growths of one dimension."""

    def __init__(
        self, dimension: int, measured: Sequence[Measurement], growths: Sequence[dict[str, Any]]
    ) -> None:
        self.dimension = dimension
        self.measured = [m for m in measured if m.dimension == dimension]
        self._growths = [g for g in growths if g["dimension"] == dimension]

    @property
    def placements(self) -> list[str]:
        """Placements of the cut, "uncut" aside."""
        return sorted({m.placement for m in self.measured} - {"uncut"})

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


def findings(
    measured: Sequence[Measurement],
    growths: Sequence[dict[str, Any]],
    dimensions: Sequence[int],
) -> list[Finding]:
    """Return the findings of a sweep, one dimension after the other."""
    found: list[Finding] = []
    for dimension in dimensions:
        results = _Results(dimension, measured, growths)
        for part in (_conditioning, _steps, _runs, _accuracy, _conforming, _large_strain):
            found += part(results)
    return found


def _exponent_text(growth: dict[str, Any]) -> str:
    if growth["exponent"] is None:
        return f"none ({growth['reason']})"
    value = f"{growth['exponent']:.3f}".replace("-", "−").replace("−0.000", "0.000")
    return f"{value} ± {max(growth['uncertainty'], 0.0005):.3f}"


def _expects(growth: dict[str, Any], low: float, high: float) -> Verdict:
    """PASS if the exponent's whole interval lies inside [low, high], FAIL if none of it does."""
    if growth["exponent"] is None:
        return Verdict.UNDECIDED
    down = growth["exponent"] - growth["uncertainty"]
    up = growth["exponent"] + growth["uncertainty"]
    if low <= down and up <= high:
        return Verdict.PASS
    return Verdict.FAIL if up < low or down > high else Verdict.UNDECIDED


def _worst(verdicts: Sequence[Verdict]) -> Verdict:
    for verdict in (Verdict.FAIL, Verdict.UNDECIDED):
        if verdict in verdicts:
            return verdict
    return Verdict.PASS


def _span(measured: Sequence[Measurement]) -> str:
    known = [m.value for m in measured if m.value is not None]
    return f"between {min(known):.4g} and {max(known):.4g}" if known else "nothing measured"


def _counts(measured: Sequence[Measurement]) -> str:
    low, high = (f(int(m.value or 0) for m in measured) for f in (min, max))
    return f"{low}" if low == high else f"{low} to {high}"


def _conditioning(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    # in space the corner tetrahedra of a cut through vertices give the steepest growth
    place = "along faces" if d == 2 else "through vertices"
    raw = [
        r.growth("condition number", f"{b}, raw", placement=place)
        for b in ("side-wise", "shifted", "heaviside")
    ]
    low, high = (-2.02, -1.98) if d == 2 else (-99.0, -2.5)
    yield Finding(
        f"{d}D raw condition number",
        f"Without scaling the condition number of a body cut {place} grows with the exponents "
        f"{', '.join(map(_exponent_text, raw))} in side-wise, shifted and unshifted unknowns.",
        "−2 in every basis" if d == 2 else "faster than in the plane, in every basis",
        _worst([_expects(g, low, high) for g in raw]),
    )
    for basis in ("side-wise", "shifted"):
        scaled, sentences = [], []
        for scaling in ("Jacobi", "nodal blocks"):
            scaled += [
                r.growth("condition number", f"{basis}, {scaling}", placement=at)
                for at in r.placements
            ]
            known = r.values("condition number", variant=f"{basis}, {scaling}", treatment="keep")
            sentences.append(f"{_span(known)} when scaled by {scaling}")
        largest = max((abs(g["exponent"]) for g in scaled if g["exponent"] is not None), default=9)
        yield Finding(
            f"{d}D scaled condition number, {basis}",
            f"For every ε it stays {', and '.join(sentences)}; no exponent is farther from zero "
            f"than {largest:.3f}.",
            "0: scaling bounds it",
            _worst([_expects(g, -_FLAT, _FLAT) for g in scaled]),
        )
    plain = r.growth("condition number", "heaviside, Jacobi")
    yield Finding(
        f"{d}D scaled condition number, unshifted",
        f"Jacobi scaling does not help the unshifted Heaviside unknowns: exponent "
        f"{_exponent_text(plain)}.",
        "grows as without scaling",
        _expects(plain, -99.0, -1.5),
    )
    known = r.all_of("CG iterations", variant="side-wise, nodal blocks", treatment="keep")
    done = [m for m in known if m.value is not None]
    yield Finding(
        f"{d}D conjugate gradients",
        f"With nodal-block scaling they take {_span(done)} iterations in side-wise unknowns for "
        "all ε and placements. Counts alone say little: the load hardly excites sliver modes.",
        "flat: fewer than twice as many as at mid-cell",
        Verdict.PASS
        if len(done) == len(known)
        and max(m.value or 0.0 for m in done)
        < 2.0 * max(m.value or 0.0 for m in done if m.size == 0.5)
        else Verdict.FAIL,
    )


def _steps(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    uncut = r.uncut("critical step")
    element = r.uncut("critical step of the smallest element")

    def kept(lumping: str) -> list[float]:
        found = r.values("critical step", treatment="keep", variant=lumping)
        return [m.value for m in found if m.value is not None]

    laws = {name: r.growth("critical step", name) for name in _VANISHING}
    yield Finding(
        f"{d}D critical step that vanishes",
        "The explicit step goes to zero with ε for "
        + ", ".join(f"{name} (exponent {_exponent_text(g)})" for name, g in laws.items())
        + f"; at ε = 1e-12 {min(min(kept(n)) for n in _VANISHING) / uncut:.1e} of the uncut one.",
        "exponent 1: in proportion to the sliver's size",
        _worst([_expects(g, 0.98, 1.02) for g in laws.values()]),
    )
    for name, bound, text in (
        ("thesis", 1.0 / sqrt(2.0), "≥ 1/√2 of the smallest element's step"),
        ("side-wise", 1.0, "≥ the smallest element's step"),
    ):
        law, steps = r.growth("critical step", name), kept(name)
        least = min(steps)
        holds = least >= (1.0 - 1e-9) * bound * element
        yield Finding(
            f"{d}D critical step, {name}",
            f"With {name} lumping it stays bounded (exponent {_exponent_text(law)}): at worst "
            f"{least / element:.3f} of the smallest element's step and {least / uncut:.3f} of the "
            "assembled uncut one.",
            text,
            _worst([_expects(law, -_FLAT, _FLAT), Verdict.PASS if holds else Verdict.FAIL]),
        )
    bare = r.growth("critical step", "without the ghost mass", "ghost penalty")
    ghost = r.values("critical step", treatment="ghost penalty", variant="side-wise")
    worst = min((m.value or 0.0) / uncut for m in ghost)
    yield Finding(
        f"{d}D ghost penalty",
        f"Its stiffness alone destroys the explicit step (exponent {_exponent_text(bare)}); with "
        f"its mass the step is at worst {worst:.3f} of the uncut one.",
        "vanishes without the mass, stays with it",
        _worst([_expects(bare, 0.3, 99.0), Verdict.PASS if worst > 0.9 else Verdict.FAIL]),
    )


def _runs(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    estimates = {
        (m.treatment, m.variant, m.size): m.value
        for m in r.values("critical step", placement="along faces")
    }
    ratios = [
        m.value / estimate
        for m in r.values("stable step found by running")
        if m.value and (estimate := estimates.get((m.treatment, m.variant, m.size)))
    ]
    missed = [m for m in r.all_of("stable step found by running") if m.value is None]
    # eight bisections of a factor 3.5: the bracket is 0.5 % wide; at 0.5 % beyond, e^80 in a run
    yield Finding(
        f"{d}D critical step found by running",
        f"Bisecting {len(ratios)} runs finds between {min(ratios, default=0.0):.3f} and "
        f"{max(ratios, default=0.0):.3f} of the estimate 2/ω_max; {len(missed)} not found.",
        "1 within 1 %",
        Verdict.PASS
        if ratios and not missed and all(abs(x - 1.0) < 0.01 for x in ratios)
        else Verdict.FAIL,
    )
    said, survived = [], True
    for lumping in ("side-wise", "thesis", *_VANISHING):
        runs = r.all_of("steps to blow-up, explicit", treatment="keep", variant=lumping)
        blown = [m for m in runs if m.value is not None]
        if lumping == "side-wise":
            survived = not blown
        how = f" after {_counts(blown)} steps" if blown else ""
        said.append(f"{lumping}: {len(blown)} of {len(runs)} blow up{how}")
    yield Finding(
        f"{d}D runs at 0.9 of the uncut step",
        "; ".join(said) + " (linear, slivers kept).",
        "side-wise stays stable for every ε",
        Verdict.PASS if survived else Verdict.FAIL,
    )


def _accuracy(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    kept = {m.size: m.value or 0.0 for m in r.values("displacement error", treatment="keep")}

    def against(treatment: str) -> list[float]:
        found = r.values("displacement error", treatment=treatment)
        return [kept[m.size] / m.value for m in found if m.value and m.size in kept]

    peers = against("conforming")
    yield Finding(
        f"{d}D displacement error",
        f"The L2 error of XFEM is {min(peers):.3f} to {max(peers):.3f} times that of the "
        f"conforming mesh of the same cells ({len(peers)} positions of the cut).",
        "0.97 to 1.03: the error does not see slivers",
        Verdict.PASS if min(peers) >= 0.97 and max(peers) <= 1.03 else Verdict.FAIL,
    )
    costs = {
        name: max(1.0 / x for x in against(name)) for name in ("drop", "merge", "ghost penalty")
    }
    yield Finding(
        f"{d}D cost of the policies",
        "Against slivers that are kept the error is at worst "
        + ", ".join(f"{cost:.3f} times as large with {name}" for name, cost in costs.items())
        + ".",
        "merge at most 1.02 times",
        Verdict.PASS if costs["merge"] <= 1.02 else Verdict.FAIL,
    )
    if d == 3:
        law = r.growth("compliance", placement="through vertices")
        merged = r.growth("compliance", treatment="merge")
        yield Finding(
            "3D compliance of the smallest piece",
            f"Under a force on it the smallest kept piece yields with exponent "
            f"{_exponent_text(r.growth('compliance'))} (cut along faces) and {_exponent_text(law)} "
            f"(through vertices); merged, {_exponent_text(merged)}.",
            "−1 if kept, 0 if merged",
            _worst(
                [
                    _expects(r.growth("compliance"), -1.02, -0.98),
                    _expects(merged, -_FLAT, _FLAT),
                ]
            ),
        )


def _conforming(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    step = r.growth("critical step", "side-wise", "conforming")
    scaled = r.growth("condition number", "side-wise, Jacobi", "conforming")
    uncut = r.uncut("critical step")
    snapped = r.values("critical step", treatment="conforming snapped", variant="side-wise")
    least = min((m.value or 0.0) / uncut for m in snapped)
    refused = len(r.all_of("mesh", treatment="conforming"))
    yield Finding(
        f"{d}D conforming mesh",
        f"Without snapping the exponent of its lumped explicit step is {_exponent_text(step)} "
        f"and that of its Jacobi-scaled condition number {_exponent_text(scaled)}; unlike "
        f"XFEM's, its slivers are badly shaped elements. {refused} meshes of the sweep do not "
        f"exist. With nodes snapped within a quarter element the step is at worst {least:.3f} "
        "of the uncut one.",
        "step exponent 1; bounded when snapped",
        _worst([_expects(step, 0.95, 1.05), Verdict.PASS if least > 0.1 else Verdict.FAIL]),
    )


def _large_strain(r: _Results) -> Iterator[Finding]:
    d = r.dimension
    said, merged = [], 0
    for treatment in ("keep", "drop", "merge"):
        for share in ("0.9", "0.7"):
            name = f"side-wise, {share} of its step"
            runs = r.values("inverted pieces", treatment=treatment, variant=name)
            ends = r.values("steps to blow-up, large strain", treatment=treatment, variant=name)
            bad = [m for m in runs if m.value]
            if treatment == "merge":
                merged += len(bad) + len(ends)
            said.append(
                f"{treatment} at {share}: {len(bad)} of {len(runs)} runs invert pieces, "
                f"{len(ends)} blow up"
            )
    yield Finding(
        f"{d}D large strain, explicit",
        "Let go from 15 % strain: " + "; ".join(said) + ".",
        "merged slivers neither invert nor blow up",
        Verdict.PASS if merged == 0 else Verdict.FAIL,
    )
    said = []
    for name in sorted({m.variant for m in r.all_of("steps to blow-up, implicit")}):
        runs = r.all_of("steps to blow-up, implicit", variant=name)
        ended = [m for m in runs if m.value is not None]
        said.append(f"{name}: {len(ended)} of {len(runs)} runs end early")
    euler = r.values("steps to blow-up, implicit", variant="implicit Euler")
    yield Finding(
        f"{d}D large strain, implicit at ten times the uncut step",
        "; ".join(said) + ".",
        "implicit Euler never ends early",
        Verdict.FAIL if euler else Verdict.PASS,
    )

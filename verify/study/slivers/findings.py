"""What the sweep says, in sentences: growth against the table that the theory gives."""

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import Any

from verify.result import Verdict
from verify.study.finding import Finding, kept_by_all
from verify.study.slivers.measurement import Measurement
from verify.study.slivers.results import (
    FLAT,
    Results,
    counts,
    expects,
    exponent_text,
    extreme,
    span,
    worst,
)
from verify.study.slivers.small_features import small_features

__all__ = ["findings"]

_VANISHING = ("consistent", "row sum", "HRZ")


def findings(
    measured: Sequence[Measurement],
    growths: Sequence[dict[str, Any]],
    dimensions: Sequence[int],
) -> list[Finding]:
    """Return the findings of a sweep, one dimension after the other."""
    found: list[Finding] = []
    for dimension in dimensions:
        results = Results(dimension, measured, growths)
        for part in (
            _conditioning,
            _steps,
            _runs,
            _accuracy,
            _conforming,
            _large_strain,
            small_features,
        ):
            found += part(results)
    return found


def _conditioning(r: Results) -> Iterator[Finding]:
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
        f"{', '.join(map(exponent_text, raw))} in side-wise, shifted and unshifted unknowns.",
        "−2 in every basis" if d == 2 else "faster than in the plane, in every basis",
        worst([expects(g, low, high) for g in raw]),
    )
    for basis in ("side-wise", "shifted"):
        scaled, sentences = [], []
        for scaling in ("Jacobi", "nodal blocks"):
            scaled += [
                r.growth("condition number", f"{basis}, {scaling}", placement=at)
                for at in r.near_nodes
            ]
            near = r.near("condition number", variant=f"{basis}, {scaling}", treatment="keep")
            sentences.append(f"{span(near)} when scaled by {scaling}")
        known = [abs(g["exponent"]) for g in scaled if g["exponent"] is not None]
        largest = extreme(max, known)
        yield Finding(
            f"{d}D scaled condition number, {basis}",
            f"Over all ε it is {', and '.join(sentences)}; of {len(known)} exponents the one "
            f"farthest from zero is {largest:.3f}.",
            "0: scaling bounds it",
            worst([expects(g, -FLAT, FLAT) for g in scaled]),
        )
    plain = r.growth("condition number", "heaviside, Jacobi")
    yield Finding(
        f"{d}D scaled condition number, unshifted",
        f"With Jacobi scaling it has the exponent {exponent_text(plain)} in unshifted Heaviside "
        "unknowns.",
        "grows as without scaling",
        expects(plain, -99.0, -1.5),
    )
    tried = r.near("CG iterations", variant="side-wise, nodal blocks", treatment="keep")
    done = [m for m in tried if m.value is not None]
    most = 2.0 * extreme(max, [m.value or 0.0 for m in done if m.size == 0.5])
    yield Finding(
        f"{d}D conjugate gradients",
        f"With nodal-block scaling they take {span(done)} iterations in side-wise unknowns at "
        f"{len(done)} of {len(tried)} ε and placements. Counts alone say little: the load hardly "
        "excites sliver modes.",
        "flat: fewer than twice as many as at mid-cell",
        kept_by_all(m.value is not None and m.value < most for m in tried),
    )


def _steps(r: Results) -> Iterator[Finding]:
    d = r.dimension
    uncut = r.uncut("critical step")
    element = r.uncut("critical step of the smallest element")

    def kept(lumping: str) -> list[float]:
        found = r.near("critical step", treatment="keep", variant=lumping)
        return [m.value for m in found if m.value is not None]

    laws = {name: r.growth("critical step", name) for name in _VANISHING}
    left = extreme(min, [step for name in _VANISHING for step in kept(name)]) / uncut
    yield Finding(
        f"{d}D critical step that vanishes",
        "The exponents of the explicit step in ε are "
        + ", ".join(f"{exponent_text(g)} ({name})" for name, g in laws.items())
        + f"; the least step is {left:.1e} of the uncut one.",
        "exponent 1: in proportion to the sliver's size",
        worst([expects(g, 0.98, 1.02) for g in laws.values()]),
    )
    for name, bound, text in (
        ("thesis", 1.0 / sqrt(2.0), "≥ 1/√2 of the smallest element's step"),
        ("side-wise", 1.0, "≥ the smallest element's step"),
    ):
        law, steps = r.growth("critical step", name), kept(name)
        least = extreme(min, steps)
        holds = kept_by_all(step >= (1.0 - 1e-9) * bound * element for step in steps)
        yield Finding(
            f"{d}D critical step, {name}",
            f"With {name} lumping its exponent is {exponent_text(law)}: at worst "
            f"{least / element:.3f} of the smallest element's step and {least / uncut:.3f} of the "
            "assembled uncut one.",
            text,
            worst([expects(law, -FLAT, FLAT), holds]),
        )
    bare = r.growth("critical step", "without the ghost mass", "ghost penalty")
    ghost = r.near("critical step", treatment="ghost penalty", variant="side-wise")
    shares = [(m.value or 0.0) / uncut for m in ghost]
    yield Finding(
        f"{d}D ghost penalty",
        f"With its stiffness alone the explicit step has the exponent {exponent_text(bare)}; with "
        f"its mass the step is at worst {extreme(min, shares):.3f} of the uncut one.",
        "vanishes without the mass, stays with it",
        worst([expects(bare, 0.3, 99.0), kept_by_all(share > 0.9 for share in shares)]),
    )


def _runs(r: Results) -> Iterator[Finding]:
    d = r.dimension
    estimates = {
        (m.placement, m.treatment, m.variant, m.size): m.value for m in r.values("critical step")
    }
    ratios = [
        m.value / estimate
        for m in r.values("stable step found by running")
        if m.value and (estimate := estimates.get((m.placement, m.treatment, m.variant, m.size)))
    ]
    missed = [m for m in r.all_of("stable step found by running") if m.value is None]
    # eight bisections of a factor 3.5: the bracket is 0.5 % wide; at 0.5 % beyond, e^80 in a run
    yield Finding(
        f"{d}D critical step found by running",
        f"Bisecting {len(ratios)} runs finds between {extreme(min, ratios):.3f} and "
        f"{extreme(max, ratios):.3f} of the estimate 2/ω_max; {len(missed)} not found.",
        "1 within 1 %",
        kept_by_all([*(abs(x - 1.0) < 0.01 for x in ratios), *(False for _ in missed)]),
    )
    said, survived = [], Verdict.UNDECIDED
    for lumping in ("side-wise", "thesis", *_VANISHING):
        runs = r.near("steps to blow-up, explicit", treatment="keep", variant=lumping)
        blown = [m for m in runs if m.value is not None]
        if lumping == "side-wise":
            survived = kept_by_all(m.value is None for m in runs)
        how = f" after {counts(blown)} steps" if blown else ""
        said.append(f"{lumping}: {len(blown)} of {len(runs)} blow up{how}")
    yield Finding(
        f"{d}D runs at 0.9 of the uncut step",
        "; ".join(said) + " (linear, slivers kept).",
        "side-wise stays stable for every ε",
        survived,
    )


def _accuracy(r: Results) -> Iterator[Finding]:
    d = r.dimension
    kept = {m.size: m.value or 0.0 for m in r.values("displacement error", treatment="keep")}

    def against(treatment: str) -> list[float]:
        found = r.values("displacement error", treatment=treatment)
        return [kept[m.size] / m.value for m in found if m.value and m.size in kept]

    peers = against("conforming")
    yield Finding(
        f"{d}D displacement error",
        f"The L2 error of XFEM is {extreme(min, peers):.3f} to {extreme(max, peers):.3f} times "
        f"that of the conforming mesh of the same cells ({len(peers)} positions of the cut).",
        "0.97 to 1.03: the error does not see slivers",
        kept_by_all(0.97 <= peer <= 1.03 for peer in peers),
    )
    costs = {
        name: extreme(max, [1.0 / x for x in against(name)])
        for name in ("drop", "merge", "ghost penalty")
    }
    yield Finding(
        f"{d}D cost of the policies",
        "Against slivers that are kept the error is at worst "
        + ", ".join(f"{cost:.3f} times as large with {name}" for name, cost in costs.items())
        + ".",
        "merge at most 1.02 times",
        kept_by_all(1.0 / x <= 1.02 for x in against("merge")),
    )
    if d == 3:
        law = r.growth("compliance", placement="through vertices")
        merged = r.growth("compliance", treatment="merge")
        yield Finding(
            "3D compliance of the smallest piece",
            f"Under a force on it the smallest kept piece yields with exponent "
            f"{exponent_text(r.growth('compliance'))} (cut along faces) and {exponent_text(law)} "
            f"(through vertices); aggregated, {exponent_text(merged)}.",
            "−1 if kept, 0 if aggregated",
            worst(
                [
                    expects(r.growth("compliance"), -1.02, -0.98),
                    expects(merged, -FLAT, FLAT),
                ]
            ),
        )


def _conforming(r: Results) -> Iterator[Finding]:
    d = r.dimension
    step = r.growth("critical step", "side-wise", "conforming")
    scaled = r.growth("condition number", "side-wise, Jacobi", "conforming")
    uncut = r.uncut("critical step")
    error = {m.size: m.value for m in r.values("displacement error", treatment="keep")}
    steps = {
        kind: [
            (m.value or 0.0) / uncut
            for m in r.near("critical step", treatment=kind, variant="side-wise")
        ]
        for kind in ("conforming snapped", "snapped")
    }
    least = {kind: extreme(min, own) for kind, own in steps.items()}
    costs = [
        m.value / kept
        for m in r.values("displacement error", treatment="snapped")
        if (kept := error.get(m.size)) and m.value
    ]
    refused = len(r.near("mesh", treatment="conforming"))
    yield Finding(
        f"{d}D conforming mesh",
        f"Without snapping the exponent of its lumped explicit step is {exponent_text(step)} "
        f"and that of its Jacobi-scaled condition number {exponent_text(scaled)}; its slivers are "
        f"elements of their own, not parts of one. {refused} meshes of the sweep do not exist. "
        "With nodes within a quarter of an edge snapped before cells are split the step is "
        f"at worst {least['conforming snapped']:.3f} of the uncut one; with nodes snapped and "
        f"none split {least['snapped']:.3f}, at an L2 error of up to "
        f"{extreme(max, costs):.3f} times XFEM's.",
        "step exponent 1; bounded when snapped",
        worst(
            [
                expects(step, 0.95, 1.05),
                *(kept_by_all(step > 0.1 for step in own) for own in steps.values()),
            ]
        ),
    )


def _large_strain(r: Results) -> Iterator[Finding]:
    d = r.dimension
    said, sound = [], []
    for treatment in ("keep", "drop", "merge", "ghost penalty"):
        for share in ("0.9", "0.7"):
            name = f"side-wise, {share} of its step"
            runs = r.near("inverted pieces", treatment=treatment, variant=name)
            ends = [
                m
                for m in r.near("steps to blow-up, large strain", treatment=treatment, variant=name)
                if m.value is not None
            ]
            bad = [m for m in runs if m.value]
            if treatment == "merge":
                sound += [not m.value for m in runs] + [False for _ in ends]
            said.append(
                f"{treatment} at {share}: {len(bad)} of {len(runs)} runs invert pieces, "
                f"{len(ends)} blow up"
            )
    yield Finding(
        f"{d}D large strain, explicit",
        "Let go from 15 % strain: " + "; ".join(said) + ".",
        "aggregated slivers neither invert nor blow up",
        kept_by_all(sound),
    )
    said = []
    for name in sorted({m.variant for m in r.near("steps to blow-up, implicit")}):
        runs = r.near("steps to blow-up, implicit", variant=name)
        ended = [m for m in runs if m.value is not None]
        said.append(f"{name}: {len(ended)} of {len(runs)} runs end early")
    euler = r.near("steps to blow-up, implicit", variant="implicit Euler")
    yield Finding(
        f"{d}D large strain, implicit at ten times the uncut step",
        "; ".join(said) + ".",
        "implicit Euler never ends early",
        kept_by_all(m.value is None for m in euler),
    )

"""Findings on cuts that have something small themselves: a thin strip, a wedge, a corner."""

from collections.abc import Iterator
from math import nan

from verify.result import Verdict
from verify.study.finding import Finding, kept_by_all
from verify.study.slivers.placements import SMALL_FEATURES
from verify.study.slivers.results import (
    FLAT,
    Results,
    counts,
    expects,
    exponent_text,
    extreme,
    worst,
)

__all__ = ["small_features"]

_WORDS = {
    "two cuts apart": "The strip between two cuts ε apart",
    "crossing cuts": "Two cuts that cross at ε from a vertex",
    "corner cut off": "A corner of the body cut off at ε",
}
_ALONE = (
    " A free corner is an element alone: its step is the element's, not that of the assembled body."
)
_TREATMENTS = ("keep", "merge", "ghost penalty")


def small_features(r: Results) -> Iterator[Finding]:
    """Conditioning, steps, compliance and runs of each such cut."""
    for placement in SMALL_FEATURES:
        yield _growth(r, placement)
    yield _bases(r)
    yield _bending(r)
    yield _peers(r)
    yield _runs(r)


def _growth(r: Results, placement: str) -> Finding:
    """Return the growth laws; a strip has a volume like ε, a wedge or corner like ε^d."""
    d = r.dimension
    power = 1 if placement == "two cuts apart" else d
    raw = r.growth("condition number", "side-wise, raw", placement=placement)
    scaled = r.growth("condition number", "side-wise, Jacobi", placement=placement)
    merged = r.growth("condition number", "side-wise, raw", "merge", placement)
    # a strip and a corner are small through and through: no root cell, they keep their unknowns
    has_root = placement == "crossing cuts"
    low, high = (-FLAT, FLAT) if has_root else (-power - 0.02, -power + 0.02)
    ghost, is_bounded = _penalised(r, placement)
    step, steps = r.growth("critical step", "side-wise", placement=placement), _steps(r, placement)
    as_expected = [] if is_bounded is None else [is_bounded == has_root]
    return Finding(
        f"{d}D {placement}",
        f"{_WORDS[placement]}: in side-wise unknowns the condition number grows with exponent "
        f"{exponent_text(raw)}, scaled by its diagonal {exponent_text(scaled)}; "
        f"aggregated {exponent_text(merged)} without scaling; with the ghost penalty {ghost}. The "
        f"side-wise step (exponent {exponent_text(step)}) is at worst {extreme(min, steps):.3f} of "
        "the smallest element's.",
        f"−{power} raw, 0 scaled; "
        + (
            "aggregation and a ghost penalty bound it as well"
            if has_root
            else "no root cell for aggregation, nor a whole element for a ghost penalty to lean on"
        )
        + "; step at least the element's",
        worst(
            [
                expects(raw, -power - 0.02, -power + 0.02),
                expects(scaled, -FLAT, FLAT),
                expects(merged, low, high),
                expects(step, -FLAT, FLAT),
                kept_by_all(share >= 1.0 - 1e-9 for share in steps),
                kept_by_all(as_expected),
            ]
        ),
    )


def _penalised(r: Results, placement: str) -> tuple[str, bool | None]:
    """Condition number with the ghost penalty; whether within ten times mid-cell's, if measured."""
    fixed = {"treatment": "ghost penalty", "placement": placement, "variant": "side-wise, raw"}
    found = [m for m in r.all_of("condition number", **fixed) if m.size > 0.0]
    known = [(m.size, m.value) for m in found if m.value is not None]
    if not known:
        return "nothing measured", None
    (least, last), (most, first) = min(known), max(known)
    lost = len(found) - len(known)
    text = f"it goes from {first:.3g} at ε = {most:g} to {last:.3g} at ε = {least:g}"
    if lost:
        text += f", and the matrix is singular to round-off at {lost} smaller positions"
    return text, not lost and last < 10.0 * first


def _steps(r: Results, placement: str) -> list[float]:
    """Side-wise critical steps over that of the smallest element."""
    element = r.uncut("critical step of the smallest element")
    steps = r.values("critical step", treatment="keep", variant="side-wise", placement=placement)
    return [(m.value or 0.0) / element for m in steps]


def _bases(r: Results) -> Finding:
    said, absent, unknown = [], list[bool](), 0
    for placement in ("two cuts apart", "crossing cuts"):
        fixed = {"treatment": "keep", "placement": placement}
        shifted = r.all_of("condition number", variant="shifted, Jacobi", **fixed)
        thesis = r.all_of("critical step", variant="thesis", **fixed)
        missing = [[m for m in found if m.value is None] for found in (shifted, thesis)]
        # two coincident cuts are one
        absent += [m in missing[0] for m in shifted if m.size > 0.0]
        own = r.all_of("condition number", variant="side-wise, Jacobi", **fixed)
        unknown += sum(m.value is None for m in own)
        said.append(
            f"{placement}: the shifted basis is missing for {len(missing[0])} of {len(shifted)} "
            f"positions, the thesis' lumping for {len(missing[1])} of {len(thesis)}"
        )
    return Finding(
        f"{r.dimension}D bases with several cuts in an element",
        "; ".join(said) + f"; side-wise unknowns are missing for {unknown}.",
        "enrichment of one cut per element cannot express two",
        kept_by_all(absent),
    )


def _bending(r: Results) -> Finding:
    fixed = {"placement": "two cuts apart"}
    law = r.growth("compliance", placement="two cuts apart")
    kept = {m.size: m.value for m in r.values("compliance", treatment="keep", **fixed)}
    peers = [
        (m.size, m.value / own)
        for m in r.values("compliance", treatment="conforming", **fixed)
        if m.value and 0.0 < m.size < 0.5 and (own := kept.get(m.size))
    ]
    size, ratio = min(peers, default=(nan, nan))
    why = (
        " The shape functions of whole elements do not let a strip inside them bend; dropped, "
        "there is no strip any more."
    )
    return Finding(
        f"{r.dimension}D stiffness of a strip thinner than its elements",
        f"Held at one end, it yields to a force with exponent {exponent_text(law)} as XFEM keeps "
        f"it; a beam would with −3. At ε = {size:g} the conforming mesh yields {ratio:.0f} times "
        f"as far, and that has but one layer of elements.{why if ratio > 2.0 else ''}",
        "−1, and softer in the conforming mesh",
        worst([expects(law, -1.02, -0.98), Verdict.PASS if ratio > 2.0 else Verdict.UNDECIDED]),
    )


def _peers(r: Results) -> Finding:
    laws = {
        p: r.growth("critical step", "side-wise", "conforming", placement=p) for p in SMALL_FEATURES
    }
    uncut = r.uncut("critical step")
    snapped = [
        (m.value or 0.0) / uncut
        for p in SMALL_FEATURES
        for m in r.values("critical step", treatment="snapped", variant="side-wise", placement=p)
    ]
    split = [m for m in r.measured if m.treatment == "conforming" and m.placement in SMALL_FEATURES]
    refused = [m for m in split if m.quantity == "mesh"]
    unknown = [m for m in split if m.quantity == "compliance" and m.value is None]
    return Finding(
        f"{r.dimension}D conforming meshes of small features",
        "The explicit step of the split mesh has the exponents "
        + ", ".join(f"{exponent_text(g)} ({p})" for p, g in laws.items())
        + f"; {len(refused)} meshes do not exist, and {len(unknown)} are singular to round-off "
        "whatever the scaling. Snapped without splitting, the step is at worst "
        f"{extreme(min, snapped):.3f} of the uncut one: features below half an element are gone.",
        "1 when split; bounded when snapped",
        worst(
            [
                *(expects(g, 0.95, 1.05) for g in laws.values()),
                kept_by_all(share > 0.1 for share in snapped),
            ]
        ),
    )


def _runs(r: Results) -> Finding:
    said, stable = [], list[bool]()
    for placement in SMALL_FEATURES:
        for treatment in _TREATMENTS:
            fixed = {"placement": placement, "treatment": treatment}
            linear = r.all_of("steps to blow-up, explicit", variant="side-wise", **fixed)
            blown = [m for m in linear if m.value is not None]
            swings = r.values("inverted pieces", **fixed)
            inverted = [m for m in swings if m.value]
            if placement != "corner cut off":
                stable += [m.value is None for m in linear]
            ended = r.values("steps to blow-up, implicit", **fixed)
            if not blown and not inverted and not ended:
                continue
            early = f", {len(ended)} implicit ones end early" if ended else ""
            after = f" after {counts(blown)} steps" if blown else ""
            said.append(
                f"{placement}, {treatment}: {len(blown)} of {len(linear)} linear runs blow "
                f"up{after}, {len(inverted)} of {len(swings)} at large strain invert "
                f"pieces{early}"
            )
    return Finding(
        f"{r.dimension}D runs with small features",
        "At 0.9 of the assembled uncut step, and from 15 % strain at 0.9 and 0.7 of their own: "
        + ("; ".join(said) or "none")
        + ". All others go through."
        + (_ALONE if r.dimension == 2 else ""),
        "side-wise is stable below the smallest element's step; but for free corners at 0.9 of the "
        "uncut one",
        kept_by_all(stable),
    )

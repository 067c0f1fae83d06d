"""Opening profiles of a case: reference and solvers in one figure, with the reference's band."""

import math
from collections.abc import Iterator, Sequence

from verify.report.blocks import Drawing, Figure
from verify.report.figures.plots import profile_panel
from verify.report.figures.style import Palette
from verify.report.notation import solver_title
from verify.result import CaseResult, OpeningCurve, OpeningProfile

_REFERENCE = "reference"
_FAR = 20.0  # times the reference's largest jump, and longer than the cut: it would hide the others
_NOTHING = 1e-12  # of the length of the line: jumps below are round-off


def opening_figures(result: CaseResult, palette: Palette) -> list[Figure]:
    """Return the profiles along every cut; a figure without panels is a sentence."""
    return [f for profile in result.openings for f in _figures(profile, result, palette)]


def _figures(profile: OpeningProfile, result: CaseResult, palette: Palette) -> Iterator[Figure]:
    curves = [c for c in profile.curves if len(c.normal) == len(profile.arc) > 1]
    if not curves:
        return
    when = "" if profile.time is None else f", at {profile.time:.4g} s ({profile.why})"
    place = f"{profile.cut}{when}"
    length = profile.arc[-1] - profile.arc[0]
    reference = next((c for c in curves if c.solver == _REFERENCE), None)
    largest = max(map(_largest, curves))
    if largest <= _NOTHING * length:
        yield Figure([], f"{place}: the jump is zero along the whole cut, to round-off.")
        return
    scale = _largest(reference) if reference else min(map(_largest, curves))
    far = [c for c in curves if c is not reference and _largest(c) > max(_FAR * scale, length)]
    others = [c for c in curves if c is not reference and c not in far]
    left_out = ", ".join(f"{_name(c)} (up to {_largest(c):.2g} m)" for c in far)
    panels = [
        panel
        for part in ("normal", "tangential")
        if (panel := _panel(profile, part, reference, others, _NOTHING * length, palette))
    ]
    said = f"{place}: {profile.where}. {_band_text(reference, result)}"
    yield Figure(panels, said + (f" Off the scale, and left out: {left_out}." if far else ""))


def _largest(curve: OpeningCurve) -> float:
    """Return the largest jump of a curve, m; infinite if it has one that is not finite."""
    values = [abs(v) for v in (*curve.normal, *curve.tangential)]
    return max(values, default=0.0) if all(map(math.isfinite, values)) else math.inf


def _panel(
    profile: OpeningProfile, part: str, reference: OpeningCurve | None,
    others: Sequence[OpeningCurve], nothing: float, palette: Palette,
) -> Drawing | None:  # fmt: skip
    shown = [*([reference] if reference else []), *others]
    curves = [(_name(c), getattr(c, part)) for c in shown]
    if all(abs(v) <= nothing for _, values in curves for v in values if math.isfinite(v)):
        return None
    band = None
    if reference is not None and any(half := getattr(reference, f"{part}_band")):
        middle = getattr(reference, part)
        band = (
            [v - w for v, w in zip(middle, half, strict=True)],
            [v + w for v, w in zip(middle, half, strict=True)],
        )
    title = f"{profile.cut}: {part} jump, m"
    return profile_panel(title, profile.arc, curves, palette, x_title="arc length, m", band=band)


def _name(curve: OpeningCurve) -> str:
    if curve.solver == _REFERENCE:
        return "exact" if curve.level is None else "reference"
    return solver_title(curve.solver)


def _band_text(reference: OpeningCurve | None, result: CaseResult) -> str:
    if reference is None:
        return "There is no reference to draw."
    source = result.reference.source or "unnamed"
    if reference.level is None:
        return f"The reference ({source}) has no uncertainty."
    if not reference.normal_band:
        return f"The reference ({source}) has too few levels for a band of uncertainty."
    widest = max(reference.normal_band)
    return (
        f"Grey band: uncertainty of the reference ({source}) from the differences of its levels, "
        f"at most {widest:.2g} m of the normal jump."
    )

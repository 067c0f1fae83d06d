"""The sweep: every sliver size × treatment × basis or lumping, one measurement each."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from time import perf_counter
from typing import Any, Literal

from verify.study.in_processes import in_processes
from verify.study.slivers.accuracy import displacement_error
from verify.study.slivers.bodies import (
    DENSITY,
    TREATMENTS,
    SweptBody,
    background,
    soft,
    swept_body,
    uncut_body,
)
from verify.study.slivers.conditioning import BASES, SCALINGS, HeldStiffness
from verify.study.slivers.explicit_step import LUMPINGS, estimated_step, mass_of
from verify.study.slivers.findings import Finding, findings
from verify.study.slivers.growth import growth
from verify.study.slivers.measurement import Measurement
from verify.study.slivers.placements import PLACEMENTS, SMALL_FEATURES, Placement
from verify.study.slivers.running import run_measurements
from verify.xfem.critical_step import element_critical_steps
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh

__all__ = ["SIZES", "SliverStudy", "sliver_study"]

SIZES = (0.5, 1e-1, *(10.0**-k for k in range(2, 13)), 0.0)
_QUICK_SIZES = (0.5, 1e-1, 1e-3, 1e-4, 1e-6, 1e-12, 0.0)
# conforming meshes of small features in space end at 1e-4: three sizes for a fit above it
_QUICK_SMALL = (0.5, 1e-3, 3e-4, 1e-4, 1e-6, 1e-12, 0.0)
_SMALL = (*SIZES[:4], 3e-4, *SIZES[4:])
_QUICK_TREATMENTS = {  # of other placements than along faces, by whether the cuts are small
    False: ("keep", "conforming", "snapped"),
    True: ("keep", "merge", "ghost penalty", "conforming", "snapped"),
}
_Part = Placement | Literal["uncut", "runs"]
_FITTED = ("condition number", "CG iterations", "compliance", "displacement error", "critical step")


@dataclass(frozen=True)
class SliverStudy:
    """What the sweep found.

    Attributes
    ----------
    quick : bool
    dimensions : tuple of int
    measurements : list of Measurement
    growths : list of dict
        Exponent of each series over small sizes, with its uncertainty and reason.
    findings : list of Finding
    seconds : float
        Wall time of the sweep.
    """

    quick: bool
    dimensions: tuple[int, ...]
    measurements: list[Measurement]
    growths: list[dict[str, Any]]
    findings: list[Finding]
    seconds: float

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return asdict(self)


def sliver_study(
    dimensions: Sequence[int] = (2, 3),
    quick: bool = False,
    announce: Callable[[str], None] = lambda text: None,
    processes: int = 1,
) -> SliverStudy:
    """Run the sweep.

    Parameters
    ----------
    dimensions : sequence of {2, 3}
    quick : bool
        Fewer sizes and shorter runs.
    announce : callable, optional
        Told what is done.
    processes : int
        Side by side; nothing that is measured is a time, so they disturb nothing.

    Raises
    ------
    ValueError
        If a dimension is neither 2 nor 3, or there is none.
    ChildProcessError
        If a process is killed.
    """
    if not dimensions or any(d not in (2, 3) for d in dimensions):
        raise ValueError(f"dimensions {list(dimensions)}; expected 2, 3 or both")
    start = perf_counter()
    parts: list[tuple[int, _Part]] = []
    for dimension in dimensions:
        parts += [(dimension, "uncut"), *((dimension, p) for p in PLACEMENTS[dimension])]
        parts.append((dimension, "runs"))
    measured = in_processes(_measured, [(*part, quick) for part in parts], processes)
    found: dict[tuple[int, _Part], list[Measurement]] = {}
    for index, measurements in measured:
        found[parts[index]] = measurements
        announce("{}D, {}: {} of {} parts".format(*parts[index], len(found), len(parts)))
    ordered = [measurement for part in parts for measurement in found[part]]
    growths = _growths(ordered)
    seconds = perf_counter() - start
    return SliverStudy(
        quick, tuple(dimensions), ordered, growths, findings(ordered, growths, dimensions), seconds
    )


def _measured(dimension: int, part: _Part, quick: bool) -> list[Measurement]:
    """Measure one part: the uncut body, a placement of the cut, or the bodies that run."""
    mesh = background(dimension, quick)
    if part == "uncut":
        return _uncut(mesh)
    if part == "runs":  # at and around the critical step, and at large strain
        return list(run_measurements(mesh, quick))
    return list(_swept(mesh, part, quick))


def _uncut(mesh: SimplexMesh) -> list[Measurement]:
    body = uncut_body(mesh)
    template = Measurement(mesh.dim, "uncut", 0.0, "uncut", "side-wise", "", None, "s")
    whole = estimated_step(body, mass_of(body, "side-wise"))
    element = float(element_critical_steps(mesh, soft(mesh.dim), DENSITY).min())
    return [
        replace(template, quantity="critical step", value=whole),
        replace(template, quantity="critical step of the smallest element", value=element),
    ]


def _swept(mesh: SimplexMesh, placement: Placement, quick: bool) -> Iterator[Measurement]:
    treatments: tuple[str, ...] = TREATMENTS
    small = placement in SMALL_FEATURES
    if quick and placement != "along faces":
        treatments = _QUICK_TREATMENTS[small]
    quick_sizes, sizes = (_QUICK_SMALL, _SMALL) if small else (_QUICK_SIZES, SIZES)
    for treatment in treatments:
        for size in quick_sizes if quick else sizes:
            base = Measurement(mesh.dim, placement, size, treatment, "", "", None)
            try:
                body = swept_body(mesh, placement, size, treatment)
            except ValueError as problem:
                # such meshes are a result: a generator without snapping makes or refuses them
                yield replace(base, quantity="mesh", reason=str(problem))
                continue
            yield from _static(body, base)
            yield from _steps(body, base)


def _static(body: SweptBody, base: Measurement) -> Iterator[Measurement]:
    stiffness = HeldStiffness(body)
    for basis in BASES if not body.is_conforming else BASES[:1]:
        for scaling in SCALINGS:
            base = replace(base, variant=f"{basis}, {scaling}")
            try:
                condition = stiffness.condition_number(basis, scaling)
                count, residual = stiffness.iterations(basis, scaling)
            except XfemError as problem:  # a basis that this body does not have
                yield replace(base, quantity="condition number", reason=str(problem))
                continue
            yield replace(base, quantity="condition number", value=condition)
            text = "" if residual <= 1e-10 else f"residual {residual:.1e} after {count} iterations"
            yield replace(
                base, quantity="CG iterations", value=None if text else float(count), reason=text
            )
    base = replace(base, variant="", quantity="compliance", unit="m/N", value=None, reason="")
    try:
        yield replace(base, value=stiffness.compliance)
    except XfemError as problem:
        yield replace(base, reason=str(problem))
    if body.placement == "along faces":
        yield replace(base, quantity="displacement error", unit="", value=displacement_error(body))


def _steps(body: SweptBody, base: Measurement) -> Iterator[Measurement]:
    base = replace(base, quantity="critical step", unit="s")
    names = list(LUMPINGS)
    if body.is_conforming:
        names = ["side-wise", "consistent"]  # without a cut, lumping is lumping
    for lumping in names:
        base = replace(base, variant=lumping, value=None, reason="")
        try:
            yield replace(base, value=estimated_step(body, mass_of(body, lumping)))
        except XfemError as problem:
            yield replace(base, reason=str(problem))
    if body.ghost is not None:
        mass = mass_of(body, "side-wise", with_ghost=False)
        value = estimated_step(body, mass)
        yield replace(base, variant="without the ghost mass", value=value, reason="")


def _growths(found: list[Measurement]) -> list[dict[str, Any]]:
    def key(m: Measurement) -> tuple[int, str, str, str, str]:
        return (m.dimension, m.placement, m.treatment, m.variant, m.quantity)

    chosen = sorted((m for m in found if m.quantity in _FITTED and m.placement != "uncut"), key=key)
    growths = []
    for name, group in groupby(chosen, key):
        series = list(group)
        law = growth([m.size for m in series], [m.value for m in series])
        fields = ("dimension", "placement", "treatment", "variant", "quantity")
        growths.append(dict(zip(fields, name, strict=True)) | asdict(law))
    return growths

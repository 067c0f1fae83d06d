"""What only a run can tell: where it becomes unstable, when it blows up, what turns inside out."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product

from verify.study.slivers.bodies import SweptBody, swept_body, uncut_body
from verify.study.slivers.explicit_step import (
    LUMPINGS,
    estimated_step,
    linear_course,
    mass_of,
    step_by_running,
)
from verify.study.slivers.inversion import Swing, swing
from verify.study.slivers.measurement import Measurement
from verify.study.slivers.placements import SMALL_FEATURES
from verify.xfem.dynamics import (
    CentralDifferences,
    EnergyMomentum,
    ImplicitEuler,
    Integrator,
    RealTimeEuler,
    Trapezoidal,
)
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh

__all__ = ["EXPLICIT_SHARE", "IMPLICIT_MULTIPLE", "run_measurements"]

EXPLICIT_SHARE = 0.9  # of the uncut step
IMPLICIT_MULTIPLE = 10.0  # of the uncut step
_POLICIES = ("keep", "drop", "merge", "ghost penalty")
_LARGE = (("inverted pieces", "pieces"), ("steps to blow-up, large strain", "steps"))
_SHARES = (0.9, 0.7)  # of the body's own linear step, at large strain
_SIZES = (0.5, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-12, 0.0)
_QUICK_SIZES = (0.5, 1e-3, 1e-7, 0.0)
_NO_THESIS = ("two cuts apart", "crossing cuts")  # its lumping needs one cut per element
_RUN = {True: 500, False: 2000}  # steps, quick or not
_SWING = {True: 1000, False: 4000}
_IMPLICIT_SIZES = (1e-3, 1e-12)  # of small features
_IMPLICIT_RUN = {True: 10, False: 100}
_IMPLICIT: dict[str, Callable[..., Integrator]] = {
    "linearised implicit Euler": RealTimeEuler,
    "implicit Euler": ImplicitEuler,
    "trapezoidal": Trapezoidal,
    "energy–momentum": EnergyMomentum,
}


def run_measurements(mesh: SimplexMesh, quick: bool) -> Iterator[Measurement]:
    """Run bodies with slivers: linear and explicit, at large strain, implicit.

    The whole grid of treatments and sizes with the cut along faces, and a few sizes of cuts that
    have something small themselves.
    """
    whole = uncut_body(mesh)
    uncut = estimated_step(whole, mass_of(whole, "side-wise"))
    for treatment in ("keep", "ghost penalty") if quick else _POLICIES:
        for size in _QUICK_SIZES if quick else _SIZES:
            body = swept_body(mesh, "along faces", size, treatment)
            yield from _explicit(body, uncut, quick)
    for treatment in _POLICIES:
        for size in (1e-1, 1e-3) if quick else (0.5, 1e-1, 1e-2, 1e-3, 1e-6, 1e-12, 0.0):
            body = swept_body(mesh, "along faces", size, treatment, hung=True)
            yield from _at_large_strain(body, quick)
            if treatment != "drop":
                yield from _implicit(body, uncut, quick)
    for placement in SMALL_FEATURES:
        for treatment in ("keep", "merge", "ghost penalty"):
            for size in (1e-3,) if quick else (1e-3, 1e-6, 1e-12):
                body = swept_body(mesh, placement, size, treatment)
                yield from _explicit(body, uncut, quick, bisected=False)
                body = swept_body(mesh, placement, size, treatment, hung=True)
                yield from _at_large_strain(body, quick)
                if not quick and size in _IMPLICIT_SIZES:
                    yield from _implicit(body, uncut, quick)


def _base(body: SweptBody, variant: str, quantity: str, unit: str = "") -> Measurement:
    return Measurement(
        body.dimension, body.placement, body.size, body.treatment, variant, quantity, None, unit
    )


def _explicit(
    body: SweptBody, uncut: float, quick: bool, bisected: bool = True
) -> Iterator[Measurement]:
    # the penalty's own mass makes any lumping of the rest pointless
    for lumping in LUMPINGS if body.ghost is None else ("side-wise",):
        blow_up = _base(body, lumping, "steps to blow-up, explicit", "steps")
        by_running = _base(body, lumping, "stable step found by running", "s")
        try:
            mass = mass_of(body, lumping)
            estimate = estimated_step(body, mass)
        except XfemError as problem:
            yield replace(blow_up, reason=str(problem))
            continue
        course = linear_course(body, mass, EXPLICIT_SHARE * uncut, _RUN[quick])
        text = f"{course.reason}; t = {course.time:.3g} s"
        yield replace(blow_up, value=float(course.steps) if course.blown_up else None, reason=text)
        if not bisected or (quick and body.size not in (0.5, 1e-3)):
            continue
        try:
            low, high = step_by_running(body, mass, estimate)
        except ValueError as problem:
            yield replace(by_running, reason=str(problem))
            continue
        text = f"between {low:.5g} and {high:.5g} s; estimate {estimate:.5g} s"
        yield replace(by_running, value=0.5 * (low + high), reason=text)


def _at_large_strain(body: SweptBody, quick: bool) -> Iterator[Measurement]:
    alone = quick or body.ghost is not None or body.placement in _NO_THESIS
    for lumping in ("side-wise",) if alone else ("side-wise", "thesis"):
        mass = mass_of(body, lumping)
        try:
            step = estimated_step(body, mass)
        except XfemError as problem:  # the penalty's mass on a corner that has next to none
            for share, name in product(_SHARES, _LARGE):
                variant = f"{lumping}, {share:g} of its step"
                yield replace(_base(body, variant, *name), reason=str(problem))
            continue
        for share in _SHARES:
            scheme = partial(CentralDifferences, step_size=share * step)
            end = swing(body, mass, scheme, _SWING[quick])
            variant = f"{lumping}, {share:g} of its step"
            text = _said(end, share * step)
            inverted = _base(body, variant, *_LARGE[0])
            yield replace(inverted, value=float(end.inverted), reason=text)
            blow_up = _base(body, variant, *_LARGE[1])
            value = float(end.steps) if end.blown_up else None
            yield replace(blow_up, value=value, reason=text)


def _implicit(body: SweptBody, uncut: float, quick: bool) -> Iterator[Measurement]:
    mass = mass_of(body, "side-wise")
    step = IMPLICIT_MULTIPLE * uncut
    for name, scheme in _IMPLICIT.items():
        start = partial(scheme, step_size=step)
        end = swing(body, mass, start, _IMPLICIT_RUN[quick], every=1)
        text = _said(end, step)
        blow_up = _base(body, name, "steps to blow-up, implicit", "steps")
        yield replace(blow_up, value=float(end.steps) if end.blown_up else None, reason=text)


def _said(end: Swing, step: float) -> str:
    return (
        f"{end.reason}; t = {end.steps * step:.3g} s; "
        f"largest energy {end.energy:.4g} times that at the start"
    )

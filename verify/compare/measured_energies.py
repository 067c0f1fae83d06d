"""Energies of a motion, measured on what its solver hands over, each with its interval.

Strain energy is that of the displacements, kinetic energy that of the velocities with the declared
mass (`verify.compare.inertia`), which gravity pulls at. Work of dead loads follows from the
displacements, that of supports that move from momenta and stresses
(`verify.compare.support_work`), what damping takes from its rate at the output times. The solver's
own ledger is asked only for what no field shows: the work of loads that change in place, and of
supports that jump or follow an exact field. Its word then is the interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from verify.compare.hooke import Law
from verify.compare.inertia import Inertia, Part, inertia_of
from verify.compare.load_work import load_work
from verify.compare.locate import SolutionField
from verify.compare.mass import Kinetic
from verify.compare.strain_energy import cell_dissipation
from verify.compare.support_work import support_work
from verify.errors import InputError
from verify.scene import BodyForce, Gravity, Scene, Traction
from verify.scene.physics import Support
from verify.solution import Solution

Array = NDArray[np.float64]
Ledger = Mapping[str, Array]


@dataclass(frozen=True)
class Energies:
    """Parts of an energy balance over the output times (2D: per metre of thickness).

    Parameters
    ----------
    parts : mapping of str to (t,) array
        By the names of a ledger, J; empty if there are none.
    widths : mapping of str to (t,) array
        Half-widths of their intervals, J; a part that is not in it is known.
    lacking : str
        Why there are none; empty if there are.
    said : dict of str to str
        Which mass was taken, and which parts are the solver's word.
    """

    parts: Ledger = field(default_factory=dict)
    widths: Ledger = field(default_factory=dict)
    lacking: str = ""
    said: dict[str, str] = field(default_factory=dict)

    @property
    def width(self) -> Array:
        """Half-width (t,) of the sum of all parts, J."""
        count = len(next(iter(self.parts.values()), ()))
        return np.sum(list(self.widths.values()), axis=0) if self.widths else np.zeros(count)


def measured_energies(
    scene: Scene,
    solution: Solution,
    law: Law,
    strain: Array,
    whole: Kinetic,
    density: float | Array,
    separated: Sequence[Part],
) -> Energies:
    """Measure the energies of a solution with velocities.

    Parameters
    ----------
    scene : Scene
    solution : Solution
    law : Law
    strain : (t,) array
        Strain energy of the displacements, J.
    whole : Kinetic
        Of the velocities.
    density : float or (m,) array
        kg/m³, of each cell.
    separated : sequence of Part
        All parts of the solution.
    """
    inertia = inertia_of(solution, density, whole, separated)
    found = {"kinetic": inertia.kinetic, "strain": strain}
    widths = {"kinetic": inertia.width}
    said = {"kinetic_energy": inertia.note}
    weight = [load.acceleration for load in scene.loads if isinstance(load, Gravity)]
    if weight:
        pulled = np.einsum("n,tna->ta", inertia.weights, solution.displacement)
        found["gravity"] = -pulled @ np.sum(weight, axis=0)
        widths["gravity"] = inertia.moment @ np.abs(np.sum(weight, axis=0))
    if any(scene.analysis.damping):
        found["damping"], widths["damping"] = _damped(scene, solution, law, inertia)
    for name, (known, width, unknown) in {
        "work_of_loads": _loads(scene, solution),
        "work_of_supports": _supports(scene, solution, law, inertia),
    }.items():
        if unknown and name not in solution.ledger:
            why = f"{unknown}, and the solver does not state it"
            return Energies(lacking=why)
        if unknown:
            own = np.asarray(solution.ledger[name]) - solution.ledger[name][0]
            known, width = own, width + np.abs(own - known)
            said[name] = f"{unknown}; it is the solver's word"
        if known.any() or width.any():
            found[name], widths[name] = known, width
    return Energies(found, {n: w for n, w in widths.items() if w.any()}, "", said)


def _loads(scene: Scene, solution: Solution) -> tuple[Array, Array, str]:
    """Work of all loads but gravity, its half-width, and what of it cannot be measured."""
    total, width = np.zeros((2, len(solution.times)))
    for load in scene.loads:
        if isinstance(load, Gravity):
            continue
        one = load_work(scene, load, solution) if isinstance(load, BodyForce | Traction) else None
        if one is None and load.history is not None and _is_let_go(load.history):
            continue
        if one is None:
            kind = load.kind.replace("_", " ")
            return total, width, f"the work of a load ({kind}) is not known between output times"
        total, width = total + one[0], width + one[1]
    return total, width, ""


def _is_let_go(table: Sequence[tuple[float, float]]) -> bool:
    """Whether a load ends at t = 0, so that it does no work in the motion."""
    before = [factor for time, factor in table if time <= 0.0]
    return bool(before) and not any([before[-1], *(f for time, f in table if time > 0.0)])


def _supports(
    scene: Scene, solution: Solution, law: Law, inertia: Inertia
) -> tuple[Array, Array, str]:
    """Work of supports, its half-width, and why it cannot be measured."""
    still = np.zeros(len(solution.times))
    if all(_stands_still(scene, support) for support in scene.supports):
        return still, still, ""
    parts = scene, solution, law
    try:
        work, width = support_work(*parts, inertia.matrix, inertia.weights)
        if inertia.lumped is not None:
            width = width + np.abs(work - support_work(*parts, inertia.lumped, inertia.weights)[0])
    except InputError as problem:
        return still, still, f"the work of supports that move is not known: {problem.what}"
    moved = np.abs(np.diff(work, prepend=0.0))
    return work, width + inertia.off * np.cumsum(moved), ""


def _stands_still(scene: Scene, support: Support) -> bool:
    """Whether a support is from the start where it stays."""
    if support.history or support.timed or support.displacement == "exact":
        return False
    at_home = support.rotation is None and not any(support.displacement)
    return at_home or scene.initial.kind == "equilibrium"


def _damped(scene: Scene, solution: Solution, law: Law, inertia: Inertia) -> tuple[Array, Array]:
    """Energy (t,) that Rayleigh damping took, and its half-width, J.

    Its rate is α v·Mv + β v·Kv, never negative, at the output times. Between them it is taken as a
    cubic spline; the half-width is what lines between the same rates differ by, with less than four
    output times all of it.
    """
    mass, stiffness = scene.analysis.damping
    rate = 2.0 * mass * inertia.kinetic
    if stiffness:
        assert solution.velocity is not None
        base = SolutionField(solution)
        rate = rate + stiffness * np.array([
            cell_dissipation(base.with_nodal(v), base.with_nodal(u), law).sum()
            for u, v in zip(solution.displacement, solution.velocity, strict=True)
        ])  # fmt: skip
    times = solution.times
    lines = steps = _between(times, rate)
    off = np.abs(lines)
    if len(times) > 3:
        steps = np.diff(CubicSpline(times, rate).antiderivative()(times))
        off = np.abs(steps - lines)
    off += 2.0 * mass * _between(times, inertia.width)
    return np.concatenate([[0.0], np.cumsum(steps)]), np.concatenate([[0.0], np.cumsum(off)])


def _between(times: Array, rate: Array) -> Array:
    """Integrals (t − 1,) of a rate that is a line between output times."""
    steps: Array = 0.5 * np.diff(times) * (rate[1:] + rate[:-1])
    return steps

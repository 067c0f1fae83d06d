"""The account of a motion: energies, momenta and separated parts over the output times.

Energies are measured on the fields of the solver, each with its interval. Strain energy follows
from displacements; kinetic energy from velocities with the declared mass (`verify.compare.mass`),
which gravity pulls at. Work of dead loads follows from displacements. Work of moving supports
follows from momenta and stresses (`verify.compare.outer_work`), damping from its rate at the
output times. The solver's own ledger is kept beside them, to be compared. It is taken alone only
where no field shows the work: of loads that change in place, and of supports that jump or follow an
exact field.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from verify.compare.hooke import Law, cell_dissipation, cell_strain_energies
from verify.compare.locate import SolutionField
from verify.compare.mass import (
    Inertia,
    Kinetic,
    Part,
    density_of,
    inertia_of,
    kinetic,
    separated_parts,
)
from verify.compare.outer_work import load_work, support_work
from verify.errors import InputError
from verify.scene import BodyForce, Gravity, Scene, Traction, is_uniform
from verify.scene.physics import Support
from verify.solution import Solution

Array = NDArray[np.float64]
Ledger = Mapping[str, Array]


# Roache's factor of safety, and orders of integrals over time: 1 where nothing is resolved
_SAFETY, _ORDERS = 3.0, (1.0, 4.0)


# What a half-width of each part is from; `mass` says which mass was taken.
_WIDTH_FROM = {
    "kinetic": "the kinetic energy, which is {mass}; expected the `mass` of the solution",
    "gravity": "the weight, whose mass is {mass}; expected the `mass` of the solution",
    "damping": "the energy damped between outputs; expected more of them",
    "work_of_loads": "the work of loads between outputs; expected more of them, and at kinks",
    "work_of_supports": "the work of supports between outputs, of which more are expected, and by "
    "a mass that is {mass}",
}


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
    sources : dict of str to str
        Which mass was taken, and which parts are the solver's word.
    """

    parts: Ledger = field(default_factory=dict)
    widths: Ledger = field(default_factory=dict)
    lacking: str = ""
    sources: dict[str, str] = field(default_factory=dict)

    @property
    def width(self) -> Array:
        """Half-width (t,) of the sum of all parts, J."""
        count = len(next(iter(self.parts.values()), ()))
        return np.sum(list(self.widths.values()), axis=0) if self.widths else np.zeros(count)

    @property
    def width_from(self) -> str:
        """Say where most of the half-width is from, and what makes it smaller; empty if zero."""
        if not self.widths:
            return ""
        widest = max(self.widths, key=lambda name: float(self.widths[name].max()))
        if widest in self.sources:  # by the solver's word alone
            return f"the {widest.replace('_', ' ')}: {self.sources[widest]}"
        return _WIDTH_FROM[widest].format(mass=self.sources["kinetic_energy"])


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
    sources = {"kinetic_energy": inertia.note}
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
            sources[name] = f"{unknown}; it is the solver's word"
        if known.any() or width.any():
            found[name], widths[name] = known, width
    return Energies(found, {n: w for n, w in widths.items() if w.any()}, "", sources)


def _loads(scene: Scene, solution: Solution) -> tuple[Array, Array, str]:
    """Sum the work of all loads but gravity, its half-width, and the loads that it lacks."""
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
    """Tell whether a load ends at t = 0, so that it does no work in the motion."""
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
    """Tell whether a support stays in one place from the start."""
    if support.history or support.timed or support.displacement == "exact":
        return False
    at_home = support.rotation is None and not any(support.displacement)
    return at_home or scene.initial.kind == "equilibrium"


def _damped(scene: Scene, solution: Solution, law: Law, inertia: Inertia) -> tuple[Array, Array]:
    """Compute the energy (t,) that Rayleigh damping took, and its half-width, J.

    Its rate is α v·Mv + β v·Kv, never negative, at the output times. Between them it is taken as a
    cubic spline. The half-width is the difference from lines between the same rates, with less than
    four output times all of it; and Richardson's, from every second and every fourth output time:
    rates that jump at cuts and kinks, and vibrations that output times do not resolve, are not told
    by one curve through them.
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
    lines, steps = _between(times, rate), _by_spline(times, rate)
    off = np.abs(steps - lines) if len(times) > 3 else np.abs(lines)
    off += 2.0 * mass * _between(times, inertia.width)
    taken, lines_off = (np.concatenate([[0.0], np.cumsum(one)]) for one in (steps, off))
    seldom, rarely = (_seldom(times, rate, taken, stride) for stride in (2, 4))
    ratio = rarely[-1] / max(seldom[-1], 1e-300)  # 2^p + 1 of an order p
    order = np.clip(np.log2(max(ratio - 1.0, 1e-300)), *_ORDERS)
    return taken, lines_off + _SAFETY * seldom / (2.0**order - 1.0)


def _by_spline(times: Array, rate: Array) -> Array:
    """Compute integrals (t − 1,) of a cubic spline through a rate; of lines, if they are few."""
    if len(times) < 4:
        return _between(times, rate)
    return np.diff(CubicSpline(times, rate).antiderivative()(times))


def _seldom(times: Array, rate: Array, taken: Array, stride: int) -> Array:
    """Compute how far an integral (t,) is, at most so far, from ones of fewer times."""
    found = np.zeros_like(taken)
    for first in range(stride):
        at = np.arange(first, len(times), stride)
        steps = _by_spline(times[at], rate[at])
        off = np.abs(np.concatenate([[0.0], np.cumsum(steps)]) - (taken[at] - taken[first]))
        own = np.arange(at[-1] + 1)
        found[own] = np.maximum(found[own], off[np.searchsorted(at, own)])
    return np.maximum.accumulate(found)


def _between(times: Array, rate: Array) -> Array:
    """Compute integrals (t − 1,) of a rate that is a line between output times."""
    steps: Array = 0.5 * np.diff(times) * (rate[1:] + rate[:-1])
    return steps


_ROUND_OFF = 1e-12  # of the largest energy: a sum of energies is not known better
# Parts of a ledger and the sign with which they enter the constant sum: stored and damped energy is
# added, work of loads and supports is subtracted.
SIGNS = {
    "kinetic": 1.0, "strain": 1.0, "gravity": 1.0, "damping": 1.0, "work_of_loads": -1.0,
    "work_of_supports": -1.0,
}  # fmt: skip
# energy taken by the time scheme, by tie forces of a released cut, with removed material and by a
# projected state: only on request
SCHEME = {"algorithmic": 1.0, "cut_work": 1.0, "projection": 1.0, "removed_energy": 1.0}


@dataclass(frozen=True)
class Balance:
    """Trend, jumps and oscillation of a total over time, in its own unit.

    Parameters
    ----------
    drift : float
        Largest distance from the first value.
    slope : float
        Secular change per second: least squares, together with the jumps.
    slope_error : float
        Its standard error, 1/s; zero if nothing is left to estimate it from.
    oscillation : float
        Largest distance from trend and jumps: it stays bounded if the slope is zero.
    jumps : (c,) array
        Step at each cut beside the trend.
    off : Balance or None
        Half-widths of all these, for a total that is not known to round-off.
    """

    drift: float
    slope: float
    slope_error: float
    oscillation: float
    jumps: Array
    off: "Balance | None" = None


def total_energy(ledger: Mapping[str, Array], scheme: bool = False) -> Array | None:
    """Sum (t,) of a ledger's parts that physics keeps constant; None without any of them.

    The solver's own ``total`` is not read. `scheme` adds energy that the time scheme dissipates or
    that was removed. The sum is then an identity of the solver's steps, and its changes are errors
    of account.
    """
    signs = {**SIGNS, **(SCHEME if scheme else {})}
    parts = [sign * np.asarray(ledger[name]) for name, sign in signs.items() if name in ledger]
    return np.sum(parts, axis=0) if parts else None


def energy_scale(ledger: Mapping[str, Array]) -> float:
    """Compute energy that drifts are measured against, J: the largest that moved from part to part.

    The largest kinetic or strain energy, or change of any other part: a potential has no zero.
    It is 0 if that is round-off of the largest part.
    """
    stored = [np.abs(ledger[name]).max() for name in ("kinetic", "strain") if name in ledger]
    moved = [np.ptp(ledger[name]) for name in SIGNS if name in ledger]
    largest = max((np.abs(ledger[name]).max() for name in SIGNS if name in ledger), default=0.0)
    scale = float(max([*stored, *moved], default=0.0))
    return scale if scale > _ROUND_OFF * largest else 0.0


def balance(
    times: Array, total: Array, cuts: Sequence[float] = (), width: Array | None = None
) -> Balance:
    """Separate trend, jumps and oscillation of a total.

    Parameters
    ----------
    times : (t,) array
        s.
    total : (t,) array
    cuts : sequence of float
        Times at which something was cut; those not inside the range of `times` count not. A
        value at the time of a cut is taken as before it.
    width : (t,) array, optional
        Half-widths of the intervals of `total`.
    """
    inner = sorted({cut for cut in cuts if times[0] <= cut < times[-1]})
    steps = [(times > cut).astype(float) for cut in inner]
    span = max(float(np.ptp(times)), 1e-300)
    columns = np.column_stack([np.ones_like(times), (times - times[0]) / span, *steps])
    start = total - total[0]  # a potential may be large: its zero is of no interest
    solved, _, rank, _ = np.linalg.lstsq(columns, start, rcond=None)
    rest = start - columns @ solved
    spare = len(times) - rank
    error = 0.0
    if spare > 0:
        inverse = np.linalg.pinv(columns.T @ columns)
        error = float(np.sqrt(rest @ rest / spare * inverse[1, 1]))
    return Balance(
        float(np.abs(start).max()), float(solved[1] / span), error / span,
        float(np.abs(rest).max()), np.asarray(solved[2:]),
        None if width is None else _off(columns, width, span),
    )  # fmt: skip


def _off(columns: Array, width: Array, span: float) -> Balance:
    """Propagate half-widths `width` of a total to a balance."""
    fit = np.linalg.pinv(columns)
    solved = np.abs(fit) @ width
    rest = np.abs(np.eye(len(width)) - columns @ fit) @ width
    drift = float((width[1:] + width[0]).max(initial=0.0))
    return Balance(drift, float(solved[1] / span), 0.0, float(rest.max()), solved[2:])


NO_VELOCITIES = "the solution has no velocities"
_MOST = 24  # parts


@dataclass(frozen=True)
class MotionAccount:
    """Energies, momenta and parts over the output times of a solution (2D: per metre).

    Parameters
    ----------
    times : (t,) array
        s.
    energies : Energies
        As measured.
    stated : mapping of str to (t,) array
        The solver's own ledger, J; empty if it has none.
    strain : (t, parts) array
        Strain energies of the parts, integrated from the displacements, J.
    whole : Kinetic or None
        Of the whole body; None without velocities.
    parts : list of Part
        At most 24, the heaviest.
    motions : list of Kinetic
        Of each part; empty without velocities.
    lighter : int
        Parts that are not among them.
    """

    times: Array
    energies: Energies
    stated: Mapping[str, Array]
    strain: Array
    whole: Kinetic | None
    parts: list[Part]
    motions: list[Kinetic]
    lighter: int = 0


def motion_account(scene: Scene, solution: Solution, law: Law) -> MotionAccount:
    """Integrate energies and momenta of a solution and of its parts, exactly for its fields."""
    density = density_of(scene, solution)
    every = separated_parts(solution, density)
    heaviest = sorted(part.mass for part in every)[-_MOST:]
    parts = [part for part in every if part.mass >= heaviest[0]][:_MOST]
    field = SolutionField(solution)
    of_cells = (
        cell_strain_energies(field.with_nodal(u), law) for u in solution.displacement
    )  # one output time after the other: all at once are too many numbers
    sums = [(one.sum(), [one[part.cells].sum() for part in parts]) for one in of_cells]
    total, strain = (np.array(column) for column in zip(*sums, strict=True))
    whole, motions = None, []
    if solution.velocity is not None and scene.material.density is not None:
        whole = kinetic(solution, density)
        motions = [whole] if len(parts) == 1 else [
            kinetic(solution, density, part.cells) for part in parts
        ]  # fmt: skip
    energies = Energies(lacking=NO_VELOCITIES)
    if whole is not None:
        energies = measured_energies(scene, solution, law, total, whole, density, every)
    stated = {name: np.asarray(part, dtype=float) for name, part in solution.ledger.items()}
    lighter = len(every) - len(parts)
    return MotionAccount(solution.times, energies, stated, strain, whole, parts, motions, lighter)


def uniform_force(scene: Scene) -> Array | None:
    """Force per mass (d,), m/s², of gravity and uniform body forces; None if it changes."""
    found = np.zeros(scene.dimension)
    for load in scene.loads:
        if isinstance(load, Gravity):
            found += load.acceleration
        elif isinstance(load, BodyForce):
            if load.force == "exact" or not is_uniform(load.force) or load.history is not None:
                return None
            if not scene.material.is_uniform:
                return None
            assert scene.material.density is not None
            found += np.asarray(load.force, dtype=float) / scene.material.density
    return found

"""Static equilibrium at finite rotation: load steps whose energy is accounted for.

An equilibrium that is not stable is left along its softest mode. A membrane that is slack has next
to no stiffness: its tangent gets a tension that falls to nothing.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, SingularStiffnessError, XfemError, finite_array
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.loads_and_supports import check_fixed
from verify.xfem.rigid_motion import RigidMotions
from verify.xfem.statics import ROUND_OFF, SHARES, UNSEEN, Newton, NotInEquilibriumError, Place

_INVERSE_ITERATIONS = 12
_FIRST_WAY_OUT = 0.1  # of the size of the body, along the softest mode
_SHORTENINGS = 24  # halvings of it
# of a slack membrane: tension over μ at first, below which the consistent tangent is tried, and the
# least; the factor by which a full step lets it fall
_TAUT, _SLACK, _LEAST, _FALL = 1.0, 1e-3, 1e-6, 0.1


def is_stable(newton: Newton, displacement: Floats) -> bool:
    """Tell whether the consistent tangent at a displacement (N, d) is positive definite.

    A factorisation without pivoting exists only then; conjugate gradients, from forces in all
    directions, meet a negative curvature among the first extreme ones that they find.
    """
    newton.linearise(displacement, 1.0)
    try:
        newton.inverse().solve(_random_force(newton))
    except SingularStiffnessError:
        return False
    return True


def way_out(newton: Newton, place: Place, load: Floats) -> Place | None:
    """Place of less potential energy along the softest mode of an unstable equilibrium.

    None if the curvature is not negative there: the stiffness is then singular, not indefinite.
    """
    mode = _softest_mode(newton, place.displacement)
    if mode is None:
        return None
    reach = float(np.ptp(newton.force.phantom.mesh.points, axis=0).max())
    for halving in range(_SHORTENINGS):
        step = _FIRST_WAY_OUT * 0.5**halving * reach * mode
        trials = [newton.place(place.displacement + sign * step, load) for sign in (1.0, -1.0)]
        best = min(trials, key=lambda trial: trial.energy)
        if best.energy < place.energy - UNSEEN * abs(place.energy):
            return best
    return None


def _softest_mode(newton: Newton, displacement: Floats) -> Floats | None:
    """Compute the mode (N, d) of negative curvature, its largest entry one; None if there is none.

    By inverse iterations with as much of the rotational tangent as leaves it positive definite.
    """
    for rotational in SHARES[1:]:
        newton.linearise(displacement, rotational)
        mode = _random_force(newton)
        try:
            inverse = newton.inverse()
            for _ in range(_INVERSE_ITERATIONS):
                mode = inverse.solve(mode)
                mode[newton.fixed] = 0.0
                mode /= np.abs(mode).max()
        except SingularStiffnessError:
            continue
        tangent = newton.linearise(displacement, 1.0)
        if mode.ravel() @ (tangent @ mode.ravel()) < 0.0:
            return mode
    return None


def _random_force(newton: Newton) -> Floats:
    forces = np.random.default_rng(0).standard_normal(newton.fixed.shape)
    return np.where(newton.fixed, 0.0, forces)


class Descent(Newton):
    """Newton's method down the potential energy of a membrane.

    Tangents, not forces, have a least tension; it falls as long as full steps lower the energy. The
    consistent tangent follows where it is positive definite.
    """

    def __init__(self, force: InternalForce, fixed: Bools) -> None:
        super().__init__(force, fixed)
        self._least = _TAUT

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Respond linearly to a prescribed change, as a taut membrane does."""
        self._least = _TAUT
        return self._solve(start, change, 0.0, self._least)

    def _next(self, place: Place, load: Floats) -> Place:
        """Go down the energy; where no correction does, raise the least tension and stay."""
        correction = self._downhill(place)
        share = self._share_downhill(place, correction, load)
        if share == 0.0:
            self._least = max(self._least, _SLACK) / _FALL
            return place
        self._least *= _FALL if share == 1.0 else 1.0
        return self.place(place.displacement + share * correction, load)

    def _downhill(self, place: Place) -> Floats:
        """Solve for a correction along which the energy falls."""
        if self._least < _SLACK:
            try:
                return self._solve(place, None, 1.0)
            except SingularStiffnessError:
                pass
        return self._solve(place, None, 0.0, max(self._least, _LEAST))


_HALVINGS = 6  # of a load step
_COMPARED = 2  # of them, on a second path
_SAMPLES = 16  # places of the supports on the whole path that are looked at beforehand
_MOST_STRAIN = 0.5  # root mean square of held edges: parts of a body turn by 58° against each other
_UNBALANCED = 0.25  # of the energy, between it and the trapezoidal rule for the work
_SAME = 1e-6  # of the energy, between two paths; of the displacement half way, on a straight one
_INVERTED = 1e-3  # of the volume: cells at singular points do turn inside out
_MOST_WAYS_OUT = 4


class PathCheck(NamedTuple):
    """Checks that an equilibrium has passed.

    Attributes
    ----------
    stable : bool or None
        Whether the consistent tangent is positive definite; None where it is singular without a
        mode of negative curvature (a slack membrane, a collapsed cell).
    compared : int
        Load steps that were solved on a second path, in halves.
    dismissed : tuple of float
        Strain energies in joules of equilibria that were found and left for one of less energy.
    """

    stable: bool | None
    compared: int
    dismissed: tuple[float, ...]


class _Step(NamedTuple):
    """State (N, d) at the end of a load step, and its energies."""

    displacement: Floats
    corrections: int
    energy: float  # strain energy, J
    potential: float  # less the work of the loads, J
    excess: float  # of the strain energy over the work, J
    allowed: float  # of it, J
    trusted: bool  # energy and work agree, hardly any volume turned inside out


class LoadPath:
    """Equilibria on the way from load factor 0 to 1.

    A step counts under two conditions. Its gain of strain energy is the work of reactions and loads
    by the trapezoidal rule, up to a quarter; and hardly any volume turned inside out. It may store
    less where supports move no body but rigidly, as a body that stiffens under dead loads does. Any
    other step is solved again in two halves. If both paths end at one energy, the state counts; if
    not, the state of less potential energy does. So a column that buckles or an arch that snaps
    through is found. A state with more energy than its supports and loads supplied is left or
    refused.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array
    prescribed : callable
        Displacement (N, d) of the fixed components at a load factor, zero elsewhere. Where it is
        straight, in proportion to the factor, but turns bodies, supports move along rotations
        (`RigidMotions.turned_path`): the path tells where supports are, `RigidMotions.follow` from
        where Newton's method starts.
    load : (N, d) float array
        Dead nodal forces at load factor 1.
    newton : Newton
    """

    def __init__(
        self,
        force: InternalForce,
        fixed: Bools,
        prescribed: Callable[[float], Floats],
        load: Floats,
        newton: Newton,
    ) -> None:
        self._force, self._fixed, self._load, self._newton = force, fixed, load, newton
        self._motions = RigidMotions(force.phantom, fixed) if force.is_corotational else None
        self._prescribed = prescribed if self._motions is None else self._along_turns(prescribed)
        self._sampled: dict[float, Floats] = {}
        self._stable: bool | None = None
        self._compared = 0
        self._dismissed: list[float] = []

    def _along_turns(self, prescribed: Callable[[float], Floats]) -> Callable[[float], Floats]:
        """Return the path; if it is straight and turns bodies, one along rotations instead."""
        assert self._motions is not None
        whole = prescribed(1.0)
        turned = self._motions.turned_path(whole)
        if turned is None:
            return prescribed
        straight = np.abs(prescribed(0.5) - 0.5 * whole).max() <= _SAME * np.abs(whole).max()
        return turned if straight else prescribed

    def check(self) -> PathCheck:
        """Return the checks so far."""
        return PathCheck(self._stable, self._compared, tuple(self._dismissed))

    def follow(self, displacement: Floats, parts: int) -> tuple[Floats, tuple[int, ...]]:
        """Find the equilibrium (N, d) at load factor 1, and the corrections of every step.

        Raises
        ------
        NotInEquilibriumError
            If a step does not converge, or none of two paths is accounted for.
        """
        steps: list[_Step] = []
        for k in range(parts):
            steps += self._advance(displacement, k / parts, (k + 1) / parts, _HALVINGS)
            displacement = steps[-1].displacement
        return displacement, tuple(step.corrections for step in steps)

    def settle(self, displacement: Floats) -> Floats:
        """Leave an unstable equilibrium at load factor 1 for a stable one of less energy.

        Raises
        ------
        NotInEquilibriumError
            If none is found.
        """
        newton, load = self._newton, self._load
        for _ in range(_MOST_WAYS_OUT):
            if is_stable(newton, displacement):
                self._stable = True
                return displacement
            if self._force.is_membrane:  # slack ones have no stiffness across their plane
                return displacement
            place = newton.place(displacement, load)
            out = way_out(newton, place, load)
            if out is None:
                return displacement
            energy = self._force.evaluate(displacement)[1]
            self._dismissed.append(energy)
            displacement, _ = newton.solve(out.displacement, np.zeros_like(load), load)
        raise NotInEquilibriumError(
            f"equilibria of {', '.join(f'{energy:.6g}' for energy in self._dismissed)} J are "
            "unstable, and no stable one was found beside them; expected a positive definite "
            "stiffness. Other supports or loads that break a symmetry may help"
        )

    def _advance(self, start: Floats, since: float, until: float, room: int) -> list[_Step]:
        """Take steps from one load factor to another, halved as often as the checks ask for.

        `room` is how many halvings are left. They are used if

        - supports turn parts of a body too far against one another: `room` − 1 in the halves;
        - no equilibrium is found: the same; with no room left that is raised;
        - the step is not trusted: at most `_COMPARED`, and the better path counts. With no room
          left the step counts, unless its energy is more than the work, which is refused.
        """
        middle = 0.5 * (since + until)

        def halves(room: int) -> list[_Step]:
            first = self._advance(start, since, middle, room)
            return first + self._advance(first[-1].displacement, middle, until, room)

        if room > 0 and self._strains(start, since, until):
            return halves(room - 1)
        try:
            whole = self._step(start, until)
        except NotInEquilibriumError:
            if room == 0:
                raise
            return halves(room - 1)
        if whole.trusted:
            return [whole]
        if room == 0:
            if whole.excess > whole.allowed:
                raise self._refusal(whole, until, "smaller steps were not tried")
            return [whole]
        self._compared += 1
        try:
            path = halves(min(room - 1, _COMPARED))
        except NotInEquilibriumError as error:
            raise self._refusal(whole, until, f"in two halves: {error}") from None
        return self._better(whole, path)

    def _better(self, whole: _Step, path: list[_Step]) -> list[_Step]:
        """Choose the path to the lower potential energy of two to one load factor."""
        other = path[-1]
        near = _SAME * max(whole.energy, other.energy) + self._floor()
        if abs(whole.energy - other.energy) <= near:
            return [whole]
        lower, higher = ([whole], other) if whole.potential < other.potential else (path, whole)
        self._dismissed.append(higher.energy)
        return lower

    def _refusal(self, step: _Step, until: float, why: str) -> NotInEquilibriumError:
        return NotInEquilibriumError(
            f"the equilibrium found at load factor {until:.4g} stores {step.energy:.6g} J, but "
            f"supports and loads account for {step.energy - step.excess:.6g} J of it; {why}"
        )

    def _strains(self, start: Floats, since: float, until: float) -> bool:
        """Tell whether supports turn parts of a body far against one another on the way."""
        if self._motions is None:
            return False
        within = [k / _SAMPLES for k in range(1, _SAMPLES) if since < k / _SAMPLES < until]
        return any(
            self._motions.strain(start, self._change(start, factor)) > _MOST_STRAIN
            for factor in (*within, until)
        )

    def _change(self, displacement: Floats, factor: float) -> Floats:
        if factor not in self._sampled:
            self._sampled[factor] = self._prescribed(factor)
        return np.where(self._fixed, self._sampled[factor] - displacement, 0.0)

    def _step(self, start: Floats, until: float) -> _Step:
        change = self._change(start, until)
        followed = start if self._motions is None else self._motions.follow(start, change)
        before, energy_before = self._force.evaluate(followed)
        beyond = np.where(self._fixed, start + change - followed, 0.0)
        found, count = self._newton.solve(followed, beyond, until * self._load)
        after, energy = self._force.evaluate(found)
        # trapezoidal rule for ∫ f_int·du, the work of supports and loads; a rigid motion takes none
        work = 0.5 * float(np.vdot(before + after, found - followed))
        excess = energy - energy_before - work
        allowed = _UNBALANCED * max(energy, energy_before) + self._floor()
        # under dead loads alone less than the work is stored by what stiffens or snaps through
        least = -allowed if beyond.any() else -np.inf
        trusted = least <= excess <= allowed and not self._turns_inside_out(followed, found)
        potential = energy - until * float(np.vdot(self._load, found))
        return _Step(found, count, energy, potential, excess, allowed, trusted)

    def _floor(self) -> float:
        """Compute the round-off of an energy, J."""
        phantom = self._force.phantom
        size = float(np.ptp(phantom.mesh.points, axis=0).max())
        return ROUND_OFF * self._newton.largest_stiffness * size**2

    def _turns_inside_out(self, before: Floats, after: Floats) -> bool:
        if self._force.is_membrane:
            return False
        volumes = self._force.phantom.volumes
        was, now = (volumes[inverted_cells(self._force, u)].sum() for u in (before, after))
        return bool(now - was > _INVERTED * volumes.sum())


class StaticEquilibrium(NamedTuple):
    """Equilibrium of a cut body at finite rotation.

    Attributes
    ----------
    displacement : (N, d) float array
        In metres.
    energy : float
        Strain energy in joules.
    reactions : (N, d) float array
        Forces of the supports in newtons; zero at free components.
    iterations : tuple of int
        Corrections of each load step of the path that counts.
    check : PathCheck
        Checks that it has passed.
    solvers : frozenset of {"direct", "iterative"}
        Which solvers the linear systems took.
    """

    displacement: Floats
    energy: float
    reactions: Floats
    iterations: tuple[int, ...]
    check: PathCheck
    solvers: frozenset[str]


def static_equilibrium(
    force: InternalForce,
    fixed: Bools,
    prescribed: Callable[[float], Floats] | None = None,
    load: Floats | None = None,
    load_steps: int = 1,
) -> StaticEquilibrium:
    """Solve f_int(u) = load, with u given on the fixed components.

    Every body follows the rigid motion of its supports; Newton's method finds the rest. A
    correction may leave the residual as large, or the consistent tangent may not be positive
    definite. Then a line search on the potential energy follows (Armijo). Its corrections take as
    much of the rotational part as leaves the tangent positive definite. Past a limit point (a
    column that buckles, an arch that snaps through) that ends in an equilibrium beyond.

    `LoadPath` says which load steps count. The last state counts if its consistent tangent is
    positive definite; an unstable one is left along its softest mode.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array
        Every free body must be held.
    prescribed : callable, optional
        Displacement (N, d) at a fraction s in (0, 1] of the path, read where fixed; zero without.
    load : (N, d) float array, optional
        Dead nodal forces at the end of the path; they grow in proportion to s.
    load_steps : int
        Equal parts of the path at least; a part is halved where it does not lead on.

    Raises
    ------
    NotInEquilibriumError
        If a load step does not converge in 64 parts either. If its energy is more than the work
        done and no other path confirms it. Where cells have collapsed on the way, it says so: the
        force is not continuous there, and there may be no equilibrium.
    SingularStiffnessError
        If something is not held.
    XfemError
        If a shape is wrong, a number not finite, or the load steps are not positive.

    Examples
    --------
    A strip that is bent by its own weight, by more than linear statics could:

    >>> import verify.xfem as xfem
    >>> strip = xfem.cut_mesh(xfem.rectangle_mesh((16, 2), upper=(4.0, 0.25)), [])
    >>> force = xfem.InternalForce(strip, xfem.isotropic(1e5, 0.3, "plane strain"))
    >>> held = xfem.Supports.none(strip).prescribe(strip, strip.mesh.points[:, 0] == 0.0)
    >>> load = xfem.body_force(strip, [0.0, -1e3])
    >>> found = xfem.static_equilibrium(force, held.fixed, load=load)
    >>> found.check.stable, bool(abs(found.reactions[:, 1].sum() - 1e3) < 1e-6)
    (True, True)
    """
    phantom = force.phantom
    shape = (phantom.node_count, phantom.mesh.space)
    check_fixed(fixed, shape)
    if force.is_membrane and not force.is_corotational:
        raise XfemError("linear kinematics of a membrane at finite rotation; expected corotational")
    if load_steps < 1:
        raise XfemError(f"{load_steps} load steps; expected at least one")
    full_load = np.zeros(shape) if load is None else finite_array(load, "load", shape)

    def wanted(factor: float) -> Floats:
        values = np.zeros(shape) if prescribed is None else prescribed(factor)
        if values.shape == shape:  # free components may be anything
            values = np.where(fixed, values, 0.0)
        return finite_array(values, "prescribed displacement", shape)

    newton = Descent(force, fixed) if force.is_membrane else Newton(force, fixed)
    path = LoadPath(force, fixed, wanted, full_load, newton)
    displacement, counts = path.follow(np.zeros(shape), load_steps)
    displacement = path.settle(displacement)
    internal, energy = force.evaluate(displacement)
    reactions = np.where(fixed, internal - full_load, 0.0)
    return StaticEquilibrium(displacement, energy, reactions, counts, path.check(), newton.solvers)

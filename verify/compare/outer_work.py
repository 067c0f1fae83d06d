"""Work done on a body from outside, from its motion: of dead loads, and of supports that move.

A load f(x) φ(t) does the work ∫ φ dq with q = ∫ f·u. At the output times q and its rate are known;
between them q is the cubic that they determine.

A reaction r of supports balances M a + f(u) + f_v(v) − p at the components that they hold. Let w be
any test function that has the prescribed velocity there. The power of r is the power of the
residual on w,

    r·w = ∫ P(∇u):∇w + f_v(v)·w − p·w + d/dt (w·Mv) − ẇ·Mv,

and so its work does not depend on accelerations, which no field shows between output times. Any w
gives the same work. A smooth one is the most accurate, since waves of the mesh hardly work on it.
That holds between output times, and at cuts, where the solver has other test functions than its
mesh of output. A rigid motion of the deformed body has no internal power at all: its work is the
change of momenta, to round-off. An affine field is a velocity that every linear method can have,
whatever it does at its cuts. So the rigid part of the prescribed velocity, then its affine part, is
taken exactly (`Extension`). Only the rest is harmonic in the body, in one piece across all cuts, as
if they were closed. One layer of elements, the other extreme, sees every wave at the support.

Between output times displacements are Hermite's cubic; at held nodes they are prescribed. Each part
between output times and kinks of histories is integrated by a Lobatto rule of four points. The
half-width is Richardson's from every second and every fourth output time. An extension that is not
affine is no test function of every solver. There the half-width comes from the extension in one
layer of elements, and from the difference of the two.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import cg, splu

from verify.compare.hooke import Law, stress_power, viscous_power
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.mass import assembled, boundary_facets, shape_functions
from verify.compare.simplices import EDGES, cells_of, nodes_of_facets, simplex_rule
from verify.errors import InputError
from verify.geometry.simplices import measures, places_of
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction
from verify.scene.parts import Pieces, held_nodes, pieces_on_part
from verify.scene.physics import PrescribedMotion, factor_at, jumps
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_GAUSS = np.polynomial.legendre.leggauss(2)  # exact for the rate of a cubic times a line


def load_work(
    scene: Scene, load: BodyForce | Traction, solution: Solution
) -> tuple[Array, Array] | None:
    """Work (t,) of a load since the first output time, and the half-width of its interval, J.

    The half-width is the difference between the cubic and a line between output times: zero while
    the factor of the load is constant. None where fields do not determine the work: the load is
    another field at every time.

    Parameters
    ----------
    scene : Scene
    load : BodyForce or Traction
        Of the scene.
    solution : Solution
        With velocities. Plane: per metre of thickness.
    """
    if load.exact or load.timed:
        return None
    nodal = nodal_forces(scene, load, solution)
    assert solution.velocity is not None
    place = np.einsum("na,tna->t", nodal, solution.displacement)
    rate = np.einsum("na,tna->t", nodal, solution.velocity)
    return _worked(solution.times, load.history, place, rate)


def _worked(times: Array, history: object, place: Array, rate: Array) -> tuple[Array, Array]:
    """Integrate the factor over q, by intervals between outputs and kinks of the history."""
    table: list[tuple[float, float]] = list(history or [])  # type: ignore[call-overload]
    if len(times) < 2:
        return np.zeros(1), np.zeros(1)
    rates = CubicHermiteSpline(times, place, rate).derivative()
    steps, (at, weights) = np.diff(place) / np.diff(times), _GAUSS
    work, width = np.zeros((2, len(times)))
    for k, (a, b) in enumerate(pairwise(times)):
        cubic = line = 0.0
        for start, end in pairwise(np.unique([a, *(t for t, _ in table if a < t < b), b])):
            when = 0.5 * (start + end) + 0.5 * (end - start) * at
            factors = np.array([factor_at(table or None, float(time)) for time in when])
            shares = 0.5 * (end - start) * weights * factors
            cubic += float(shares @ rates(when))
            line += float(shares.sum() * steps[k])
        work[k + 1] = work[k] + cubic
        width[k + 1] = width[k] + abs(cubic - line)
    return work, width


def nodal_forces(
    scene: Scene, load: BodyForce | Traction, solution: Solution, time: float = 0.0,
    clip: Callable[[Pieces, Array], Pieces] | None = None,
) -> Array:  # fmt: skip
    """Compute consistent nodal forces (n, d) of a load at a time, s, without its factor, N.

    Parameters
    ----------
    clip : callable, optional
        Which pieces of simplices (q, k, d) count.
    """
    if isinstance(load, BodyForce):
        nodes, k = solution.cells, solution.cell_dimension
        pieces = Pieces.whole(np.arange(len(nodes)), k + 1)
    else:
        nodes, k = boundary_nodes_of_facets(solution), solution.cell_dimension - 1
        pieces = pieces_on_part(scene.geometry, load.where, solution.points[nodes[:, : k + 1]])
    if clip is not None:
        pieces = clip(pieces, solution.points[nodes[:, : k + 1]])
    thickness = scene.material.thickness or 1.0

    def force(points: Array, *_: object) -> Array:
        values = load.values(points.reshape(-1, solution.dimension), time)
        return thickness * values.reshape(points.shape)

    return spread(solution, nodes, k, pieces, force)


def spread(
    solution: Solution,
    simplices: Ints,
    k: int,
    pieces: Pieces,
    force: Callable[[Array, Array, Ints], Array],
) -> Array:
    """Compute consistent nodal forces (n, d) of a force per measure on pieces of simplices, N.

    Parameters
    ----------
    solution : Solution
    simplices : (q, j) int array
        Their nodes, corners first.
    k : int
        Their dimension.
    pieces : Pieces
    force : callable
        Values (m, p, d) at points (m, p, d) of m pieces, where the hats of nodes are (m, p, j), of
        simplices (m,).
    """
    place, share = simplex_rule(k, 4)
    nodes = simplices[pieces.facet]
    within = place @ pieces.barycentric
    hats = shape_functions(within.reshape(-1, k + 1), k, solution.order)
    corners = solution.points[nodes[:, : k + 1]]
    weight = (measures(corners) * pieces.share)[:, None] * share
    hats = hats.reshape(*weight.shape, -1)
    values = force(within @ corners, hats, pieces.facet)
    found = np.zeros_like(solution.points)
    np.add.at(found, nodes, np.einsum("mq,mqn,mqd->mnd", weight, hats, values))
    return found


def boundary_nodes_of_facets(solution: Solution) -> Ints:
    """Find nodes (b, f) of the facets of the outer boundary: corners first, then edges."""
    cell, opposite = boundary_facets(solution)
    return nodes_of_facets(solution.cells[cell], opposite)


# Of the largest displacement that supports prescribe: nodes that are nearer follow it; of others,
# where the field of a cut facet is a line and the formula is none, so far may be the worst.
_FOLLOWS, _MOST = 1e-6, 0.1


@dataclass(frozen=True)
class PrescribedNodes:
    """Components of nodes that supports hold, and how these move.

    Parameters
    ----------
    held : (n, d) bool array
    follows : (n, d) bool array
        Which of them are where the supports say at all output times.
    supports : list of (nodes, components, PrescribedMotion)
        A later one wins.
    """

    held: NDArray[np.bool_]
    follows: NDArray[np.bool_]
    supports: list[tuple[NDArray[np.int64], list[int], PrescribedMotion]]

    @property
    def knots(self) -> list[float]:
        """Times at which a history has a kink, s."""
        histories = [one.support.history for _, _, one in self.supports]
        return [time for history in histories for time, _ in history or ()]

    def values(self, time: float) -> Array:
        """Compute displacements (n, d), m; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            factor = factor_at(one.support.history, time)
            found[np.ix_(nodes, components)] = one.values(factor, time)
        return found

    def velocities(self, time: float, before: bool = False) -> Array:
        """Compute velocities (n, d), m/s, after a kink or before; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            found[np.ix_(nodes, components)] = one.velocities(time, before)
        return found


def nodes_held(scene: Scene, solution: Solution, where: Sequence[str]) -> list[Ints]:
    """Find nodes (h,) of a solution that supports on parts hold, by the rule of all solvers.

    Raises
    ------
    InputError
        If one holds no node.
    """
    facets = boundary_nodes_of_facets(solution)
    own = np.unique(facets)
    corners = solution.points[facets[:, : solution.cell_dimension]]
    rows = np.searchsorted(own, facets), corners
    every = solution.cells, solution.points[solution.cells[:, : solution.cell_dimension + 1]]
    found = []
    for i, one in enumerate(where):
        key = f"supports[{i}].where"
        if scene.geometry.holds_inside(one):
            found.append(held_nodes(scene, one, solution.points, every, key)[0])
        else:
            found.append(own[held_nodes(scene, one, solution.points[own], rows, key)[0]])
    return found


def prescribed_nodes(scene: Scene, solution: Solution) -> PrescribedNodes:
    """Find what the supports of a scene hold of a solution, by the rule that all solvers follow.

    Raises
    ------
    InputError
        If a support follows an exact field or jumps, holds no node, or if nodes that it holds are
        elsewhere.
    """
    for support in scene.supports:
        if support.displacement == "exact":
            raise InputError("a support follows an exact field")
        if [t for t in jumps(support.history) if solution.times[0] < t <= solution.times[-1]]:
            raise InputError("a support jumps")
    at = nodes_held(scene, solution, [support.where for support in scene.supports])
    held = np.zeros(solution.points.shape, dtype=bool)
    supports = []
    for nodes, support in zip(at, scene.supports, strict=True):
        components = list(support.held(scene.dimension))
        held[np.ix_(nodes, components)] = True
        motion = PrescribedMotion(support, solution.points[nodes], None, None)
        supports.append((nodes, components, motion))
    found = PrescribedNodes(held, held, supports)
    said = np.array([found.values(time) for time in solution.times])
    largest = float(np.abs(said).max(initial=0.0))
    off = np.abs(solution.displacement - said).max(axis=0)
    if off[held].max(initial=0.0) > _MOST * largest:
        raise InputError(f"nodes that supports hold are off by {off[held].max():.2g} m")
    return replace(found, follows=held & (off <= _FOLLOWS * largest))


_NOTHING = 1e-9  # of the largest value: an affine field that fits so well is the field


@dataclass
class Extension:
    """Fields of the nodes of a solution by their values where it is held.

    Parameters
    ----------
    solution : Solution
    held : (n, d) bool array
        Which components of which nodes have values.
    in_layer : bool
        Whether the part that is not affine ends in the cells at held nodes; else it is harmonic.

    Attributes
    ----------
    is_affine : bool
        Whether all values so far were affine where it is held, so that nothing was harmonic.
    """

    solution: Solution
    held: NDArray[np.bool_]
    in_layer: bool = False
    is_affine: bool = field(default=True, init=False)

    def of(self, values: Array, points: Array) -> tuple[Array, bool]:
        """Extend values (n, d), of which those that are held count, to all nodes (n, d).

        Parameters
        ----------
        points : (n, d) array
            Places of the nodes in which rigid and affine fields are meant, m.

        Returns
        -------
        field : (n, d) array
        is_rigid : bool
            Whether it is a rigid motion, on which no stress does work.

        Raises
        ------
        InputError
            If nodes at one place, on the faces of a cut, have different values that are not affine.
        """
        held, largest = self.held, float(np.abs(values[self.held]).max(initial=0.0))
        found = np.zeros_like(values)
        if largest == 0.0:
            return found, True
        for is_rigid, modes_of in ((True, _rigid), (False, _affine)):
            modes = modes_of(points)
            matrix = modes[:, held].T
            share = np.linalg.lstsq(matrix, (values - found)[held], rcond=1e-12)[0]
            found += np.tensordot(share, modes, axes=1)
            if np.abs((values - found)[held]).max() <= _NOTHING * largest:
                return found, is_rigid
        rest = np.where(held, values - found, 0.0)
        if not self.in_layer:
            rest = self._harmonic(rest, _NOTHING * largest)
        return found + rest, False

    def _harmonic(self, rest: Array, nothing: float) -> Array:
        """Extend the rest (n, d) by Δw = 0, without flux where it is not held."""
        self.is_affine = False
        place, found = self._places, np.zeros_like(rest)
        for axis, (own, known) in enumerate(zip(self.held.T, self._solvers, strict=True)):
            values = np.zeros(place.max() + 1)
            values[place[own]] = rest[own, axis]
            if np.abs(values[place[own]] - rest[own, axis]).max(initial=0.0) > nothing:
                raise InputError("they move the faces of a cut apart")
            if values.any():
                values[~known.fixed] = -known.solve(known.coupling @ values[known.fixed])
            found[:, axis] = values[place]
        return found

    @cached_property
    def _places(self) -> NDArray[np.int64]:
        """Number (n,) of the place of each node: the copies on the faces of a cut share one."""
        points = self.solution.points
        near = 10 * ROUND_OFF * float(np.linalg.norm(np.ptp(points, axis=0)))
        return places_of(points, near)

    @cached_property
    def _stiffness(self) -> csr_array:
        """∫ ∇N_i·∇N_j of the places."""
        solution = self.solution
        k, nodes = solution.cell_dimension, self._places[solution.cells]
        shape = cells_of(solution)
        local = np.zeros((*nodes.shape, nodes.shape[1]))
        for at, weight in zip(*simplex_rule(k, solution.order), strict=True):
            slopes = _slopes(at, shape.gradients, solution.order)
            local += (weight * shape.volume)[:, None, None] * (slopes @ np.swapaxes(slopes, 1, 2))
        matrix = assembled(local, nodes, int(self._places.max()) + 1)
        # a place of cells without volume alone has no equation
        alone = np.where(matrix.diagonal() > 0.0, 0.0, 1.0)
        return csr_array(matrix + diags_array(alone))

    @cached_property
    def _solvers(self) -> list["_Known"]:
        """Make for each component the held places, and the solver of the rest."""
        found: dict[bytes, _Known] = {}
        for own in self.held.T:
            if own.tobytes() not in found:
                fixed = np.zeros(self._places.max() + 1, dtype=bool)
                fixed[self._places[own]] = True
                rows, solve = self._stiffness[~fixed], None
                if own.any() and not fixed.all():
                    solve = splu(rows[:, ~fixed].tocsc()).solve
                found[own.tobytes()] = _Known(fixed, rows[:, fixed], solve)
        return [found[own.tobytes()] for own in self.held.T]


class _Known(NamedTuple):
    """Places (p,) that are held, their coupling to the others, and the solver of the others."""

    fixed: NDArray[np.bool_]
    coupling: csr_array
    solve: Any


def _rigid(points: Array) -> Array:
    """Return translations and rotations (q, n, d), all of size one."""
    n, d = points.shape
    modes = _affine(points).reshape(d, d + 1, n, d)
    turns = [modes[i, 1 + j] - modes[j, 1 + i] for i in range(d) for j in range(i)]
    return np.concatenate([modes[:, 0], turns])


def _affine(points: Array) -> Array:
    """Compute fields (q, n, d) that are affine in the points."""
    n, d = points.shape
    away = points - points.mean(axis=0)
    away = np.column_stack([np.ones(n), away / max(float(np.abs(away).max()), 1e-300)])
    return np.einsum("ij,nk->iknj", np.eye(d), away).reshape(-1, n, d)


def _slopes(at: Array, gradients: Array, order: int) -> Array:
    """Compute gradients (m, nodes, d) of shape functions at barycentric coordinates (k+1,)."""
    if order == 1:
        return gradients
    corners = (4.0 * at - 1.0)[:, None] * gradients
    edges = [
        4.0 * (at[a] * gradients[:, b] + at[b] * gradients[:, a]) for a, b in EDGES[len(at) - 1]
    ]
    return np.concatenate([corners, np.stack(edges, axis=1)], axis=1)


_Force = tuple[Array, list[tuple[float, float]] | None]

_PLACES = 0.5 * (1.0 + np.array([-1.0, -(0.2**0.5), 0.2**0.5, 1.0]))  # Lobatto
_SHARES = np.array([1.0, 5.0, 5.0, 1.0]) / 12.0
# derivatives at these places of the cubic through values at them
_RATES = np.linalg.solve(
    np.vander(_PLACES, increasing=True).T,
    np.array([[0.0, 1.0, 2 * s, 3 * s * s] for s in _PLACES]).T,
).T
_ORDERS, _SAFETY = (0.5, 4.0), 3.0
_INSIDE = 1e-9  # of an interval: distance from its ends at which jumps are evaluated
_SAME_TIME = 1e-9  # of the duration


def support_work(
    scene: Scene, solution: Solution, law: Law, mass: csr_array, weights: Array
) -> tuple[Array, Array]:
    """Work (t,) of supports since the first output time, and the half-width of its interval, J.

    Parameters
    ----------
    scene : Scene
    solution : Solution
        With velocities.
    law : Law
    mass : (n, n) sparse array
        kg, of the nodes (2D: per metre, as all that follows).
    weights : (n,) array
        kg, at which gravity pulls.

    Raises
    ------
    InputError
        If it is not known from the fields, with the reason.
    """
    nodes = prescribed_nodes(scene, solution)
    still = np.zeros(len(solution.times))
    if not any(one.moves for _, _, one in nodes.supports):
        return still, still
    if len(solution.times) < 3:
        raise InputError("there are less than three output times")
    forces = _forces(scene, solution, weights)
    parts = scene, solution, law, mass, nodes, forces
    smooth = _Work(*parts, Extension(solution, nodes.held))
    if smooth.all_kinks:
        raise InputError("each output time is a kink of their path, so nothing tells its error")
    steps = smooth.steps()
    if smooth.extension.is_affine:  # known once the steps have asked it
        return _since(steps), _since(smooth.off(steps))
    layer = _Work(*parts, Extension(solution, nodes.held, in_layer=True))
    other = layer.steps()
    return _since(steps), _since(layer.off(other)) + np.abs(_since(other) - _since(steps))


def _since(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])


def _forces(scene: Scene, solution: Solution, weights: Array) -> list[_Force]:
    """Compute nodal forces (n, d) of loads without their factors, N, and their histories."""
    found: list[_Force] = []
    for load in scene.loads:
        if isinstance(load, Gravity):
            found.append((np.multiply.outer(weights, np.asarray(load.acceleration)), None))
        elif isinstance(load, CutFaces):
            continue  # in balance, on whatever is continuous across a cut
        elif not isinstance(load, BodyForce | Traction) or load.exact or load.timed:
            raise InputError(f"a load ({load.kind.replace('_', ' ')}) changes in place")
        else:
            found.append((nodal_forces(scene, load, solution), load.history))
    return found


@dataclass(frozen=True)
class _Work:
    """Work of the supports of a solution with one extension of their velocities."""

    scene: Scene
    solution: Solution
    law: Law
    mass: csr_array
    nodes: PrescribedNodes
    forces: Sequence[_Force]
    extension: Extension

    def steps(self, stride: int = 1) -> Array:
        """Work (s,) between output times of which so many are one, J."""
        return np.array([self._between(a, b) for a, b in pairwise(self._picks(stride))])

    def off(self, steps: Array) -> Array:
        """Compute the half-width (t − 1,) of the steps between all output times, J.

        Three times Richardson's (Roache's factor of safety), from steps of twice and four times the
        length. The order is observed on all of them together: at most the 4 of Hermite's cubic, and
        near zero for a motion that output times do not resolve. A step without a neighbour to
        double it has the largest width of all. With a kink inside a step its change is counted as
        of the first order, and as all its own.
        """
        first, second, fourth = (self._picks(stride) for stride in (1, 2, 4))
        done, twice = _since(steps), _since(self.steps(2))
        pairs = np.flatnonzero(np.diff(second) == 2)
        change = np.abs(np.diff(twice) - np.diff(done[second]))
        fours = np.flatnonzero(np.diff(fourth) == 4)
        order = 1.0
        if len(fours):
            at = np.searchsorted(second, fourth[fours])
            before = np.abs(self.steps(4)[fours] - (twice[at + 2] - twice[at])).sum()
            after = (change[at] + change[at + 1]).sum()
            order = float(np.log2(max(before, 1e-300) / max(after, 1e-300)))
        each = 0.5 * _SAFETY * change[pairs] / (2.0 ** np.clip(order, *_ORDERS) - 1.0)
        width = np.full(len(first) - 1, each.max())
        for start, one in zip(second[pairs], each, strict=True):
            width[start : start + 2] = one
        kinked = [bool(self._inner(a, b)) for a, b in pairwise(self.solution.times)]
        for start, one in zip(second[pairs], change[pairs], strict=True):
            own = start + np.flatnonzero(kinked[start : start + 2])
            width[own] = np.maximum(width[own], _SAFETY * one)
        return width

    @property
    def all_kinks(self) -> bool:
        """Whether no output time lies between two intervals without a kink."""
        return not (np.diff(self._picks(2)) == 2).any()

    def _picks(self, stride: int) -> NDArray[np.int64]:
        """Choose output times at a stride, apart from times with a kink."""
        times = self.solution.times
        ends = [i for i in range(len(times)) if self._is_knot(times[i])]
        ends = sorted({*ends, len(times) - 1})
        runs = [range(a, b, stride) for a, b in pairwise(ends)]
        return np.concatenate([*runs, ends[-1:]]).astype(np.int64)

    @cached_property
    def _knots(self) -> Array:
        """Times of kinks, s: of supports, which may take up another velocity, and of loads."""
        of_loads = [time for _, history in self.forces for time, _ in history or ()]
        return np.array([*self.nodes.knots, *of_loads])

    @cached_property
    def _field(self) -> SolutionField:
        return SolutionField(self.solution)

    def _between(self, first: int, last: int) -> float:
        """Sum the work between two output times, J, including jumps at their ends."""
        a, b = (float(self.solution.times[i]) for i in (first, last))
        done = 0.0
        for start, end in pairwise([a, *self._inner(a, b), b]):
            done += self._smooth(first, last, start, end)
        return done

    def _inner(self, start: float, end: float) -> list[float]:
        """Find the times of kinks between two times, s."""
        same = _SAME_TIME * float(np.ptp(self.solution.times))
        return sorted(t for t in set(self._knots.tolist()) if start + same < t < end - same)

    @cached_property
    def _leaps(self) -> dict[float, Array]:
        """Velocities (n, d) that the body takes up at once, by kinks of its supports, m/s."""
        nodes, found = self.nodes, {}
        for t in set(nodes.knots):
            given = nodes.velocities(t) - nodes.velocities(t, before=True)
            found[t] = taken_up(self.mass, nodes.follows, np.zeros_like(given), given)
        return found

    def _smooth(self, first: int, last: int, start: float, end: float) -> float:
        """Integrate the work in a part of an interval without kinks, with jumps at its ends, J.

        A velocity that supports take up at once changes the kinetic energy of held nodes.
        """
        span = end - start
        prescribed = [start + span * float(np.clip(s, _INSIDE, 1 - _INSIDE)) for s in _PLACES]
        states = [self._state(first, last, start + span * s) for s in _PLACES]
        done = 0.0
        for i, sign in ((0, 1.0), (-1, -1.0)):
            if self._is_knot(float([start, end][i])):
                u, v = states[i]
                given = self.nodes.velocities(prescribed[i])
                taken = taken_up(self.mass, self.nodes.follows, v, given)
                done += sign * 0.5 * float(np.sum((taken + v) * (self.mass @ (taken - v))))
                states[i] = u, taken
        follows = self.nodes.follows
        tests, rigid = [], []
        for t, (u, v) in zip(prescribed, states, strict=True):
            velocities = np.where(follows, self.nodes.velocities(t), v)
            test, is_rigid = self.extension.of(velocities, self._points(u))
            tests.append(test)
            rigid.append(is_rigid)
        rates = np.tensordot(_RATES, tests, axes=1) / span
        momenta = [self.mass @ v for _, v in states]
        done += float(np.sum(tests[-1] * momenta[-1]) - np.sum(tests[0] * momenta[0]))
        for i, share in enumerate(_SHARES):
            u, v = states[i]
            power = self._power(prescribed[i], v, tests[i]) - float(np.sum(rates[i] * momenta[i]))
            if not rigid[i]:
                power += self._internal(u, v, tests[i])
            done += span * share * power
        return done

    def _is_knot(self, time: float) -> bool:
        times = self.solution.times
        near = _SAME_TIME * float(np.ptp(times))
        kinks = [times[0], *self.nodes.knots]
        return bool(np.abs(np.array(kinks) - time).min() <= near)

    def _state(self, first: int, last: int, time: float) -> tuple[Array, Array]:
        """Interpolate displacements and velocities (n, d) at a time by Hermite's cubic.

        At kinks between the output times velocities leap; without these leaps they are smooth.
        """
        solution, held = self.solution, self.nodes.follows
        assert solution.velocity is not None
        ends = [first, last]
        for one in ends:
            if abs(time - solution.times[one]) <= 1e-12 * np.ptp(solution.times[ends]):
                return solution.displacement[one], solution.velocity[one]
        at, us, vs = solution.times[ends], solution.displacement[ends], solution.velocity[ends]
        leaps = [(t, self._leaps[t]) for t in self._inner(*at) if t in self._leaps]
        for t, leap in leaps:
            us[1] -= (at[1] - t) * leap
            vs[1] -= leap
        cubic = CubicHermiteSpline(at, us, vs)
        u, v = cubic(time), cubic(time, 1)
        for t, leap in leaps:
            if time >= t:
                u, v = u + (time - t) * leap, v + leap
        u[held] = self.nodes.values(time)[held]
        v[held] = self.nodes.velocities(time)[held]
        return u, v

    def _points(self, u: Array) -> Array:
        """Return the places in which a motion is rigid, m: at rest for linear kinematics."""
        moved = self.scene.analysis.kinematics == "corotational"
        return self.solution.points + u if moved else self.solution.points

    def _power(self, time: float, v: Array, w: Array) -> float:
        """Subtract the power of loads from the power of damping by the mass, on velocities w, W."""
        power = self.scene.analysis.damping[0] * float(np.sum(w * (self.mass @ v)))
        for force, history in self.forces:
            power -= factor_at(history, time) * float(np.sum(force * w))
        return power

    def _internal(self, u: Array, v: Array, w: Array) -> float:
        """Compute the power of stresses, and of damping by the stiffness, on velocities w, W."""
        test, displacement = self._field.with_nodal(w), self._field.with_nodal(u)
        power = stress_power(test, displacement, self.law)
        if damping := self.scene.analysis.damping[1]:
            moving = self._field.with_nodal(v)
            power += damping * viscous_power(test, moving, displacement, self.law)
        return power


def taken_up(mass: csr_array, held: NDArray[np.bool_], rates: Array, given: Array) -> Array:
    """Let held nodes take up given rates (n, d) at once: M × rates stays the same elsewhere.

    Scaled by its diagonal a mass is as well conditioned on graded meshes (Wathen, 1987).

    Raises
    ------
    InputError
        If the iteration does not converge: the mass is no mass.
    """
    change = np.where(held, given - rates, 0.0)
    if not change.any():
        return rates
    for axis, own in enumerate(held.T):
        if own.any() and not own.all():
            coupled = mass[~own]
            diagonal = coupled[:, ~own].diagonal()
            scale = np.where(diagonal > 0.0, diagonal, 1.0) ** -0.5
            scaled = diags_array(scale) @ coupled[:, ~own] @ diags_array(scale)
            pull = -scale * (coupled[:, own] @ change[own, axis])
            found, failed = cg(scaled.tocsr(), pull, rtol=1e-12)
            if failed:
                raise InputError("the velocities that supports take up at once do not converge")
            change[~own, axis] = scale * found
    return rates + change

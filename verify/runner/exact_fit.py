"""Contradictions between an exact solution and the scene that names it, found before a run.

An exact field is a reference without a half-width: a condition of the scene that it violates counts
as an error of the solver. It is checked at points drawn with a fixed seed: supports, loads, faces
of cuts, equilibrium, initial state. It must be continuous where no cut is.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.compare.hooke import law_of
from verify.errors import InputError
from verify.geometry.simplices import (
    distance_to_pieces,
    measures,
    on_simplices,
    unit_normals,
    unit_rule,
)
from verify.printable import place_text as _place
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction
from verify.scene.parts import on_part
from verify.scene.physics import PrescribedMotion, factor_at
from verify.scene.tables import AtRest, InitialField, Moving
from verify.solvers.boundary_conditions import Boundary, ForceDensity
from verify.xfem.mesh import SimplexMesh

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_FACETS, _CELLS, _FACES = 400, 400, 40  # most samples of the boundary, the body, a cut
_ROUND_OFF = 1e-12  # of the body: of a point on a facet
_BESIDE = 1e-6  # of an element or of the body: on the side meant, and nowhere else


class OnBoundary(NamedTuple):
    """Points (n, d) on the boundary, points beside them in the body, and outward normals."""

    points: Array
    near: Array
    normals: Array


class OnCut(NamedTuple):
    """Points (n, d) of a cut, unit normals to its positive side, distances (n,) to its ends."""

    points: Array
    normals: Array
    to_end: Array


def on_boundary(mesh: SimplexMesh, rng: np.random.Generator) -> OnBoundary:
    """Draw a point inside each facet of the boundary, of some of them if they are many."""
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    chosen = _some(len(boundary.facets), _FACETS, rng)
    points = _inside(mesh.points[boundary.corners[chosen]], rng)
    middle = mesh.points[mesh.cells[boundary.facets[chosen, 0]]].mean(axis=1)
    near = points + _BESIDE * (middle - points)
    return OnBoundary(points, near, boundary.outward_normals(chosen))


def boundary_nodes(mesh: SimplexMesh) -> tuple[Array, Array]:
    """Nodes (n, d) of the boundary, and a point of the body beside each."""
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    cell = np.zeros(len(mesh.points), dtype=np.int64)
    cell[boundary.corners.ravel()] = np.repeat(boundary.facets[:, 0], boundary.corners.shape[1])
    points = mesh.points[boundary.nodes]
    middle = mesh.points[mesh.cells[cell[boundary.nodes]]].mean(axis=1)
    return points, points + _BESIDE * (middle - points)


def in_body(mesh: SimplexMesh, rng: np.random.Generator) -> Array:
    """Draw two points (n, 2, d) in each cell, in some of them if they are many."""
    corners = mesh.points[mesh.cells[_some(len(mesh.cells), _CELLS, rng)]]
    return np.stack([_inside(corners, rng), _inside(corners, rng)], axis=1)


def holds(mesh: SimplexMesh, points: Array) -> Bools:
    """Whether each of the points (n, d) lies in the body."""
    return on_simplices(points, mesh.points[mesh.cells], _ROUND_OFF * mesh.extent)


def on_cut(cut: Any, steps: Array, rng: np.random.Generator) -> OnCut:
    """Draw points on a cut: all over it, and at the distances `steps` (k,), m, from its ends."""
    points, normals = _faces(cut, rng)
    ends, outward, of_ends = end_points(cut)
    if len(ends):
        inner = ends[:, None] - steps[:, None] * outward[:, None]
        if cut.dimension == 3 or cut.faceted:  # the tangent of an arc leaves it
            points = np.concatenate([points, inner.reshape(-1, points.shape[1])])
            normals = np.concatenate([normals, np.repeat(of_ends, len(steps), axis=0)])
    far = np.full(len(points), np.inf)
    for end in ends:
        far = np.minimum(far, np.linalg.norm(points - end, axis=1))
    return OnCut(points, normals, far)


def end_points(cut: Any) -> tuple[Array, Array, Array]:
    """Return the ends (k, d) of a cut, the directions in which it would go on, and its normals.

    In space the middles of the edges of a plane patch, and points of the rim of a disc; none of
    surfaces that are curved or kinked.
    """
    pieces = cut.pieces()
    if cut.dimension == 2:
        first, last = pieces[0], pieces[-1]
        ends = np.concatenate([first.point([0.0]), last.point([1.0])])
        along = np.concatenate([first.tangent([0.0]), last.tangent([1.0])])
        outward, normals = along * [[-1.0], [1.0]], along[:, ::-1] * [-1.0, 1.0]
        closed = np.linalg.norm(ends[1] - ends[0]) <= 1e-12 * np.abs(ends).max()
        return (np.zeros((0, 2)),) * 3 if closed else (ends, outward, normals)
    if cut.plane_normal is None:
        return (np.zeros((0, 3)),) * 3
    ends, outward = pieces[0].rim()
    return ends, outward, np.tile(cut.plane_normal, (len(ends), 1))


def distances(cuts: Sequence[Any], points: Array) -> Array:
    """Distance (n,) to the nearest cut."""
    pieces = [piece for cut in cuts for piece in cut.pieces()]
    return distance_to_pieces(points, pieces) if pieces else np.full(len(points), np.inf)


def _faces(cut: Any, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (n, d) all over a cut, and unit normals there, to its positive side."""
    points, facets = cut.facets()
    corners = points[facets]
    sizes = measures(corners)
    part = rng.choice(len(corners), _FACES, p=sizes / sizes.sum())
    drawn = _inside(corners[part], rng)
    if cut.faceted:
        return drawn, unit_normals(corners)[part]
    (piece,) = cut.pieces()
    feet = piece.foot(drawn)
    return feet, piece.facing(feet)


def _inside(corners: Array, rng: np.random.Generator) -> Array:
    """Draw a point (n, d) inside each simplex (n, k, d)."""
    share = rng.dirichlet(np.ones(corners.shape[1]), len(corners))
    return np.einsum("nk,nkd->nd", share, corners)


def _some(count: int, most: int, rng: np.random.Generator) -> NDArray[np.int64]:
    return np.arange(count) if count <= most else np.sort(rng.choice(count, most, replace=False))


# Of the largest displacement, velocity or stress: what a case file states in seven digits passes,
# and a difference below it is far below any error of discretisation.
_SAME = 1e-6
# Of the stress beside an end of a cut, which grows without bounds: an end that the file states in
# nine digits is off the line of the field by 1e-4 of the least of the distances below.
_SAME_AT_ENDS = 1e-3
# Of the terms of an equation of equilibrium, taken by differences of fourth order over steps of
# _STEP of the body, _OFF of it from cuts: beside a tip truncation is some 100 (_STEP/_OFF)^4.
_BALANCED, _STEP, _OFF = 1e-4, 3e-4, 0.02
_DISTANCES = np.geomspace(1e-5, 0.1, 12)  # from cuts and their ends, of the body
_FLIGHT = 1e-9  # of momenta over the step of the differences: round-off, where nothing is strained
_FOURTH_ORDER = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))


def check_exact_fits(scene: Scene, exact: Any, mesh: SimplexMesh) -> None:
    """Raise `InputError` where the exact solution of a scene contradicts what else it says.

    Parameters
    ----------
    scene : Scene
    exact : reference.exact.ExactSolution
    mesh : SimplexMesh
        Any mesh of the body.
    """
    fit = _Fit(scene, exact, mesh)
    for finding in fit.findings():
        raise InputError(f"exact: {finding}", str(scene.file or scene.name))


class _Fit:
    """An exact field beside the scene that names it; `mesh` is any mesh of the body."""

    def __init__(self, scene: Scene, exact: Any, mesh: SimplexMesh) -> None:
        self._scene, self._exact, self._mesh = scene, exact, mesh
        self._rng = np.random.default_rng(5)
        self._size = mesh.extent
        self._cuts = [cut.whole() for cut in scene.cuts]
        self._times = [0.0]
        if scene.analysis.duration is not None:
            outputs = scene.analysis.output_times
            self._times = [0.0, outputs[len(outputs) // 2], outputs[-1]]
        self._boundary = on_boundary(mesh, self._rng)
        self._pairs = in_body(mesh, self._rng)

    def findings(self) -> Iterator[str]:
        """Say each contradiction; the first of a kind."""
        yield from self._jumps()
        for time in self._times:
            at = f" at {time:.4g} s" if self._scene.analysis.duration is not None else ""
            for kind in (self._supports, self._tractions, self._faces, self._balance):
                for text in kind(time):
                    yield text + at
        yield from self._initial_state()

    def _supports(self, time: float) -> Iterator[str]:
        """Prescribed displacements; where two hold a component, the later one counts."""
        scene, field = self._scene, self._exact.at(time)
        points, near = self._support_points()
        true = field.displacement(points, near)
        given, by = np.full_like(true, np.nan), np.zeros(true.shape, dtype=np.int64)
        for i, support in enumerate(scene.supports):
            on = np.flatnonzero(on_part(scene.geometry, support.where, points, self._size))
            place = np.ix_(on, support.held(scene.dimension))
            exact = self._exact if support.displacement == "exact" else None
            motion = PrescribedMotion(support, points[on], near[on], exact)
            given[place], by[place] = motion.values(factor_at(support.history, time), time), i
        largest = max(np.abs(true).max(initial=0.0), np.nanmax(np.abs(given), initial=0.0))
        off = np.nan_to_num(np.abs(given - true), nan=0.0)
        if off.max(initial=0.0) > _SAME * largest:
            k, c = np.unravel_index(int(off.argmax()), off.shape)
            yield (
                f"contradicts supports[{by[k, c]}] at {_place(points[k])}: u_{'xyz'[c]} is "
                f"prescribed as {given[k, c]:.6g} m and is {true[k, c]:.6g} m in the exact "
                f"solution; expected equal within {_SAME:g} of {largest:.3g} m: let the support "
                "have displacement = 'exact', or judge by [reference] kind = 'conforming'"
            )

    def _support_points(self) -> tuple[Array, Array]:
        """Points inside facets, and nodes for supports that hold no facet."""
        points, near, _ = self._boundary
        nodes, beside = boundary_nodes(self._mesh)
        for support in self._scene.supports:
            if not on_part(self._scene.geometry, support.where, points, self._size).any():
                on = on_part(self._scene.geometry, support.where, nodes, self._size)
                points, near = np.vstack([points, nodes[on]]), np.vstack([near, beside[on]])
        return points, near

    def _tractions(self, time: float) -> Iterator[str]:
        """Tractions of loads, or none, in the components that no support holds."""
        scene, (points, near, normals) = self._scene, self._boundary
        field = self._exact.at(time)
        stress = self._stress(field, points, near)
        true = np.einsum("nij,nj->ni", stress, normals)
        given, held = np.zeros_like(true), np.zeros(true.shape, dtype=bool)
        by = np.full(len(points), -1)
        for i, load in enumerate(scene.loads):
            if isinstance(load, Traction):
                on = np.flatnonzero(on_part(scene.geometry, load.where, points, self._size))
                density = ForceDensity(scene, load, field, time)
                value = density.at(points[on], near[on], normals[on])
                given[on] += factor_at(load.history, time) * value
                by[on] = i
        for support in scene.supports:
            on = np.flatnonzero(on_part(scene.geometry, support.where, points, self._size))
            held[np.ix_(on, support.held(scene.dimension))] = True
        largest = max(np.abs(stress).max(initial=0.0), np.abs(given).max(initial=0.0))
        off = np.where(held, 0.0, np.abs(given - true))
        if off.max(initial=0.0) > _SAME * largest:
            k, c = np.unravel_index(int(off.argmax()), off.shape)
            part = f"loads[{by[k]}]" if by[k] >= 0 else "a part of the boundary without a load"
            yield (
                f"contradicts {part} at {_place(points[k])}: the {'xyz'[c]} component of the "
                f"traction is {given[k, c]:.6g} Pa in the scene and {true[k, c]:.6g} Pa in the "
                f"exact solution; expected equal within {_SAME:g} of {largest:.3g} Pa: give the "
                "part a support or a traction that is 'exact', or judge by [reference] kind = "
                "'conforming'"
            )

    def _faces(self, time: float) -> Iterator[str]:
        """Tractions on both faces of each cut where it is open; no jump where it is not yet."""
        field, steps = self._exact.at(time), self._size * _DISTANCES
        level = np.abs(self._stress(field, self._boundary.points, self._boundary.near)).max()
        for cut, asked in zip(self._cuts, self._scene.cuts, strict=True):
            points, normals, to_end = on_cut(cut, steps, self._rng)
            inside = holds(self._mesh, points)
            points, normals, to_end = points[inside], normals[inside], to_end[inside]
            opens = asked.passed_at(points)
            off_tip = 1e-3 * self._times[-1]  # at the tip itself stresses are unbounded
            open_now = opens < time - off_tip if self._times[-1] else opens <= 0.0
            beside = 1e-6 * self._size * normals
            above = field.displacement(points, points + beside)
            jump = np.abs(above - field.displacement(points, points - beside)).max(axis=1)
            jump = np.where(opens > time + off_tip, jump, 0.0)
            if jump.max(initial=0.0) > _SAME * np.abs(above).max(initial=0.0):
                k = int(jump.argmax())
                yield (
                    f"jumps by {jump[k]:.3g} m across cut '{cut.name}' at {_place(points[k])}, "
                    f"which opens there at {opens[k]:.4g} s; expected a continuous displacement"
                )
            yield from self._tractions_on_faces(
                cut.name, (points[open_now], normals[open_now], to_end[open_now]), time, level
            )

    def _tractions_on_faces(
        self, name: str, at: tuple[Array, Array, Array], time: float, level: float
    ) -> Iterator[str]:
        """Hold tractions at points of an open cut against its loads; see `on_cut`."""
        (points, normals, to_end), field = at, self._exact.at(time)
        loads = [
            load for load in self._scene.loads if isinstance(load, CutFaces) and load.cut == name
        ]
        for side in (1.0, -1.0):
            outward = -side * normals
            stress = self._stress(field, points, points + side * 1e-6 * self._size * normals)
            true = np.einsum("nij,nj->ni", stress, outward)
            given = np.zeros_like(true)
            for load in loads:
                factor = factor_at(load.history, time)
                given += factor * load.on_faces(points, outward, normals, time)
            if self._scene.contact.closed:  # and whatever pressure the faces have on each other
                press = np.sum((given - true) * outward, axis=1).clip(min=0.0)
                given -= press[:, None] * outward
            local = np.abs(stress).max(axis=(1, 2), initial=0.0)
            close = np.where(to_end < 0.1 * self._size, _SAME_AT_ENDS * local, 0.0)
            bound = _SAME * max(level, np.abs(given).max(initial=0.0)) + close
            off = np.abs(given - true).max(axis=1, initial=0.0) - bound
            if off.max(initial=0.0) > 0.0:
                k = int(off.argmax())
                yield (
                    f"contradicts cut '{name}' at {_place(points[k])}: its face bears a traction "
                    f"of {_place(given[k])} Pa in the scene and {_place(true[k])} Pa in the exact "
                    f"solution; expected equal within {bound[k]:.2g} Pa: let the cut lie where "
                    "the field jumps, and end where that ends"
                )
                return
        if not self._scene.contact.closed or not len(points):
            return
        beside = 1e-6 * self._size * normals
        above, below = (field.displacement(points, points + s * beside) for s in (1.0, -1.0))
        gap = np.sum((above - below) * normals, axis=1) / max(np.abs(above).max(), 1e-300)
        apart = (gap > _SAME) & (press > bound)
        if (apart | (gap < -_SAME)).any():
            k = int(np.argmax(np.where(apart, np.inf, -gap)))
            yield (
                f"is no contact on cut '{name}' at {_place(points[k])}: its faces "
                + (f"are apart under {press[k]:.3g} Pa" if apart[k] else "overlap")
                + "; expected pressure where they touch, and no overlap"
            )

    def _jumps(self) -> Iterator[str]:
        """Differences of displacement across the body that no gradient and no cut explains."""
        field = self._exact.at(self._times[-1])
        a, b = self._segments()
        middle, half = 0.5 * (a + b), 0.5 * np.linalg.norm(b - a, axis=1)
        free = distances(self._cuts, middle) > half
        free &= self._one_material(middle, np.stack([a, b]))
        free &= field.smooth(middle, half)
        a, b = a[free], b[free]
        free = holds(self._mesh, a) & holds(self._mesh, b)
        a, b = a[free], b[free]
        along = np.zeros_like(a)
        for node, weight in zip(*unit_rule(10), strict=True):
            gradient = field.gradient(a + node * (b - a))
            along += weight * np.einsum("nij,nj->ni", gradient, b - a)
        start, end = field.displacement(a), field.displacement(b)
        largest = max(np.abs(start).max(initial=0.0), np.abs(end).max(initial=0.0))
        off = np.abs(end - start - along).max(axis=1, initial=0.0)
        if off.max(initial=0.0) > _SAME * largest:
            k = int(off.argmax())
            yield (
                f"jumps by {off[k]:.3g} m between {_place(a[k])} and {_place(b[k])}, where no cut "
                f"is; expected a continuous displacement within {_SAME:g} of {largest:.3g} m: let "
                "the cut lie where the field jumps, and end where that ends"
            )

    def _segments(self) -> tuple[Array, Array]:
        """Return the ends of segments in cells, away from faces of cuts, and across their ends.

        Those in cells must be off the ends of cuts by their length, so that the quadrature is
        exact to round-off.
        """
        steps = self._size * _DISTANCES
        ends = [end_points(cut) for cut in self._cuts]
        long = np.linalg.norm(self._pairs[:, 1] - self._pairs[:, 0], axis=1)
        middle = self._pairs.mean(axis=1)
        far = distances(self._cuts, middle) > 2.0 * long
        start, end = [self._pairs[far, 0]], [self._pairs[far, 1]]
        for cut, (places, outward, normals) in zip(self._cuts, ends, strict=True):
            points, across, _ = on_cut(cut, steps, self._rng)
            for side in (1.0, -1.0):
                away = points[:, None] + side * steps[:, None] * across[:, None]
                start.append(away[:, :-1].reshape(-1, points.shape[1]))
                end.append(away[:, 1:].reshape(-1, points.shape[1]))
            beyond = places[:, None] + steps[:, None] * outward[:, None]
            reach = 0.3 * steps[:, None] * normals[:, None]
            start.append((beyond - reach).reshape(-1, points.shape[1]))
            end.append((beyond + reach).reshape(-1, points.shape[1]))
        return np.concatenate(start), np.concatenate(end)

    def _balance(self, time: float) -> Iterator[str]:
        """Balance of stress, forces per volume and inertia inside the body."""
        scene, field, h = self._scene, self._exact.at(time), _STEP * self._size
        points = self._pairs[:, 0]
        far = distances(self._cuts, points) > _OFF * self._size
        d = scene.dimension
        around = 2 * h * np.vstack([np.eye(d), -np.eye(d)])
        far &= self._one_material(points, points + around[:, None])
        for k in range(-2, 3) if self._exact.moves else ():
            beside = self._exact.at(time + k * _STEP * self._times[-1])
            far &= beside.smooth(points, 3 * h)
        points = points[far]
        if not len(points):
            return
        terms = np.zeros((len(points), d, d + 2))
        for j, step in enumerate(h * np.eye(d)):
            for k, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
                terms[:, :, j] += (
                    weight / (12 * h) * self._stress(field, points + k * step)[:, :, j]
                )
        for load in scene.loads:
            if isinstance(load, Gravity):
                terms[:, :, d] += np.asarray(ForceDensity(scene, load).uniform(points))
            elif isinstance(load, BodyForce):
                force = ForceDensity(scene, load, field, time).at(points)
                terms[:, :, d] += factor_at(load.history, time) * force
        level = np.abs(self._stress(field, points)).max() / self._size
        if self._exact.moves:
            terms[:, :, d + 1] = self._inertia(points, time)
            momenta = float(scene.material.density or 0.0) * np.abs(field.velocity(points)).max()
            level = max(level, _FLIGHT * momenta / (_STEP * self._times[-1]))
        bound = _BALANCED * np.maximum(np.abs(terms).max(axis=(1, 2)), level)
        off = np.abs(terms.sum(axis=2)).max(axis=1)
        k = int((off - bound).argmax())
        if off[k] > bound[k]:
            left = _place(terms[k, :, :d].sum(axis=1))
            said = _place(terms[k, :, d:].sum(axis=1))
            yield (
                f"is in no equilibrium at {_place(points[k])}: div σ of the field is {left} N/m³, "
                f"the forces of the scene and inertia are {said} N/m³; expected a sum of zero "
                f"within {bound[k]:.2g} N/m³: give a body_force that is 'exact', or leave out "
                "loads that the field does not bear"
            )

    def _inertia(self, points: Array, time: float) -> Array:
        """−ρ times the acceleration (n, d), by differences of the velocity, N/m³."""
        step = _STEP * self._times[-1]
        rate = np.zeros_like(points)
        for k, weight in _FOURTH_ORDER:
            rate += weight / step * self._exact.at(time + k * step).velocity(points)
        return -float(self._scene.material.density or 0.0) * rate

    def _one_material(self, points: Array, others: Array) -> NDArray[np.bool_]:
        """Whether `others` (k, n, d) beside points (n, d) are all of the material there."""
        material = self._scene.material
        if material.is_uniform:
            return np.ones(len(points), dtype=bool)
        own = material.number_at(points)
        return np.all([material.number_at(one) == own for one in others], axis=0)

    def _initial_state(self) -> Iterator[str]:
        """Displacement and velocity at the time 0 of a motion; an equilibrium is found by it."""
        scene, initial = self._scene, self._scene.initial
        if scene.analysis.duration is None:
            return
        field, points = self._exact.at(0.0), self._pairs[:, 0]
        given: dict[str, Array] = {}
        if isinstance(initial, InitialField):
            place, speed = initial.state(points, points, field)
            given = {"displacement": place, "velocity": speed}
        elif isinstance(initial, AtRest | Moving):
            still = np.zeros_like(points)
            speed = initial.velocities(points) if isinstance(initial, Moving) else still
            given = {"displacement": still, "velocity": speed}
        for what, value in given.items():
            true = getattr(field, what)(points)
            largest = max(np.abs(true).max(), np.abs(value).max())
            off = np.abs(value - true).max(axis=1)
            k = int(off.argmax())
            if off[k] > _SAME * largest:
                yield (
                    f"contradicts initial at {_place(points[k])}: the {what} is "
                    f"{_place(value[k])} in the scene and {_place(true[k])} in the exact "
                    f"solution; expected equal within {_SAME:g}: kind = 'field', {what} = 'exact'"
                )

    def _stress(self, field: Any, points: Array, near: Array | None = None) -> Array:
        """First Piola-Kirchhoff stress (n, d, d), Pa, of the energy of the scene."""
        if self._scene.analysis.kinematics == "linear" or not self._scene.material.is_uniform:
            return np.asarray(field.stress(points, near))
        return law_of(self._scene).piola(field.gradient(points, near))

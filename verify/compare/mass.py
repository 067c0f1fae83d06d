"""Mass of a solution: kinetic energy, momenta, separated parts, and the mass that it declares.

The declared mass is checked, and taken instead of the consistent mass of the field: a body that
moves with a lumped mass keeps the energy of that mass, which for short waves is up to
`lumping_range` times as large.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, issparse
from scipy.spatial import cKDTree

from verify.compare.cell_tree import axes_of
from verify.compare.locate import ROUND_OFF
from verify.compare.simplices import EDGES, cells_of, kept_with, simplex_rule
from verify.compiled import COMPILED, njit
from verify.errors import InputError
from verify.geometry.simplices import boundary_facets as alone
from verify.geometry.simplices import connected_cells
from verify.scene import Scene
from verify.solution import Solution
from verify.solution_checks import CONSISTENT

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
_Pairs = tuple[tuple[int, int], ...]

_FEW = 2048  # cells whose numbers stay near the processor
_TURNS = {2: ((0, 1),), 3: ((1, 2), (2, 0), (0, 1))}  # axes that a rotation mixes


@dataclass(frozen=True)
class Kinetic:
    """Over the output times of a solution (2D: per metre of thickness).

    Parameters
    ----------
    mass : float
        kg.
    centre : (t, d) array
        Current centre of mass, m.
    energy : (t,) array
        ½ ∫ ρ v², J.
    linear : (t, d) array
        ∫ ρ v, N s.
    angular : (t, 1 or 3) array
        ∫ ρ x × v about the origin, x the current position, N m s.
    spin : (t, 1 or 3) array
        The same about the current centre of mass, N m s.
    linear_scale, angular_scale : float
        Largest ∫ ρ |v| and ∫ ρ |x − c||v| over time, c the centre of mass: the scale of momenta
        that cancel.
    """

    mass: float
    centre: Array
    energy: Array
    linear: Array
    angular: Array
    spin: Array
    linear_scale: float
    angular_scale: float


def density_of(scene: Scene, solution: Solution) -> float | Array:
    """Return the density in kg/m³ (membrane: kg/m²): one, or (m,) at the centroids of cells.

    0 where the scene has none.
    """
    material = scene.material
    thickness = material.thickness or 1.0
    if material.is_uniform:
        return thickness * (material.density or 0.0)
    shape = cells_of(solution)
    return thickness * np.nan_to_num(material.at(shape.corners.mean(axis=1)).density)


def kinetic(
    solution: Solution, density: float | Array, cells: NDArray[np.int64] | None = None,
    steps: slice = slice(None),
) -> Kinetic:  # fmt: skip
    """Integrate over the cells of the solution, exactly for its velocity field.

    Parameters
    ----------
    solution : Solution
    density : float or (m,) array
        kg/m³, of a membrane times its thickness; of all cells of the solution or of each.
    cells : (c,) int array, optional
        Numbers of the cells of a part; default all.
    steps : slice
        Of the output times; default all.

    Raises
    ------
    InputError
        If the solution has no velocities.
    """
    if solution.velocity is None:
        raise InputError("a solution without velocities has no kinetic energy")
    d, k = solution.dimension, solution.cell_dimension
    nodes, own = solution.cells, density * cells_of(solution).volume
    if cells is not None:
        nodes, own = nodes[cells], own[cells]
    at, share = simplex_rule(k, 2 if solution.order == 1 else 4)
    hats, total = shape_functions(at, k, solution.order), float(own.sum())
    of_nodes = np.outer(own, share @ hats)  # ∫ρ N
    weights = np.bincount(nodes.ravel(), of_nodes.ravel(), len(solution.points))
    moved, pairs = solution.points + solution.displacement[steps], _TURNS[d]
    rows = []
    for x, v in zip(moved, solution.velocity[steps], strict=True):
        centre, linear = weights @ x / max(total, 1e-300), weights @ v
        sums = _moments(x - centre, v, nodes, own, hats, share, pairs)
        orbit = [centre[a] * linear[b] - centre[b] * linear[a] for a, b in pairs]
        rows.append([*centre, *sums[:3], *linear, *(sums[3:] + orbit), *sums[3:]])
    ends = np.cumsum([d, 1, 2, d, len(pairs)])
    centres, energy, scales, linears, angular, spin = np.split(np.array(rows), ends, axis=1)
    return Kinetic(
        total, centres, energy[:, 0], linears, angular, spin, *scales.max(axis=0).tolist()
    )


def _moments(
    arms: Array, speeds: Array, nodes: Ints, own: Array, hats: Array, share: Array, pairs: _Pairs
) -> Array:
    """Integrate ½ v², |v|, |r||v| and r × v of nodal r and v (n, d), cells of masses `own` (c,)."""
    if COMPILED:
        columns, axes = np.ascontiguousarray(hats.T), axes_of(arms.shape[1])
        at_points = _moments_at(arms, speeds, nodes, own, columns, axes, pairs)
        return np.asarray(at_points @ share)
    both, sums = np.concatenate([arms.T, speeds.T]), np.zeros(3 + len(pairs))
    for few in (slice(first, first + _FEW) for first in range(0, len(own), _FEW)):
        values = np.take(both, nodes[few], axis=1) @ hats.T
        arm, speed = values.reshape(2, len(both) // 2, -1)
        mass = np.outer(own[few], share).ravel()
        moment, square = mass * speed, (speed**2).sum(axis=0)
        size, reach = np.sqrt(square), np.sqrt((arm**2).sum(axis=0))
        turns = [arm[a] @ moment[b] - arm[b] @ moment[a] for a, b in pairs]
        sums += [0.5 * mass @ square, mass @ size, mass @ (reach * size), *turns]
    return sums


@njit(cache=True)
def _moments_at(arms, speeds, nodes, own, columns, axes, pairs):
    """Sum over cells at each point (q,) of a rule; `columns` (n, q) are the shape functions."""
    points = columns.shape[1]
    arm, speed = np.empty((len(axes), points)), np.empty((len(axes), points))
    sums = np.zeros((3 + len(pairs), points))
    for i in range(len(nodes)):
        arm[:], speed[:] = 0.0, 0.0
        for n in range(len(columns)):
            node = nodes[i, n]
            for a in axes:
                x, v = arms[node, a], speeds[node, a]
                for q in range(points):  # the inner loop, so that it is vectorised
                    arm[a, q] += x * columns[n, q]
                    speed[a, q] += v * columns[n, q]
        for q in range(points):
            square = reach = 0.0
            for a in axes:
                square += speed[a, q] ** 2
                reach += arm[a, q] ** 2
            size = np.sqrt(square)
            sums[0, q] += own[i] * 0.5 * square
            sums[1, q] += own[i] * size
            sums[2, q] += own[i] * np.sqrt(reach) * size
            row = 3
            for a, b in pairs:
                sums[row, q] += own[i] * (arm[a, q] * speed[b, q] - arm[b, q] * speed[a, q])
                row += 1
    return sums


def shape_functions(place: Array, k: int, order: int) -> Array:
    """Compute values (q, n) of the nodes' shape functions at barycentric points (q, k + 1)."""
    if order == 1:
        return place
    edges = [4 * place[:, a] * place[:, b] for a, b in EDGES[k]]
    return np.column_stack([place * (2 * place - 1), *edges])


def _lumping(solution: Solution, density: float | Array) -> tuple[Array, Array]:
    """Bound the effect of lumping, where the solver does not declare its mass.

    Cells along a cut may be pieces of larger ones, at whose nodes their mass may be lumped: as
    much larger as the largest cell beside. The effect of lumping grows with the square of that
    size; and the mass of a piece then acts at the centre of the whole, up to half that size away.

    Parameters
    ----------
    solution : Solution
        With velocities.
    density : float or (m,) array
        kg/m³, of each cell.

    Returns
    -------
    kinetic : (t,) array
        Of the kinetic energy, J (2D: per metre).
    moment : (t, d) array
        Of ∫ρu, at which gravity pulls, kg m.
    """
    assert solution.velocity is not None
    k, order, nodes = solution.cell_dimension, solution.order, solution.cells
    shape = cells_of(solution)
    mass = density * shape.volume
    own, beside = _sizes(nodes[:, : k + 1], shape.corners)
    cut = _along_cuts(solution)
    larger = np.where(cut & (own > 0.0), beside / np.where(own > 0.0, own, 1.0), 1.0)
    away = np.where(cut, 0.5 * beside, 0.0)
    matrix = np.diag(lumped_shares(k, order)) - _consistent(k, order)
    kinetic, moment = [], []
    for u, v in zip(solution.displacement, solution.velocity, strict=True):
        local = v[nodes]
        change = 0.5 * np.einsum("mia,ij,mja->m", local, matrix, local)
        gradients = [
            np.einsum("mia,mib->mab", field[nodes[:, : k + 1]], shape.gradients) for field in (u, v)
        ]
        steepest = np.linalg.norm(gradients[1], axis=(1, 2)) * np.linalg.norm(
            local.mean(axis=1), axis=1
        )
        kinetic.append(mass @ (np.abs(change) * larger**2 + steepest * away))
        moment.append((mass * away) @ np.linalg.norm(gradients[0], axis=2))
    return np.array(kinetic), np.array(moment)


def consistent_mass(solution: Solution, density: float | Array) -> csr_array:
    """Compute the masses ∫ρ N_i N_j (n, n) in kg of a solution's nodes."""
    nodes, count = solution.cells, len(solution.points)
    mass = density * cells_of(solution).volume
    local = mass[:, None, None] * _consistent(solution.cell_dimension, solution.order)
    return assembled(local, nodes, count)


def assembled(local: Array, nodes: NDArray[np.int64], count: int) -> csr_array:
    """Assemble matrices (m, k, k) of cells with nodes (m, k) to a matrix (count, count)."""
    rows = np.repeat(nodes, nodes.shape[1], axis=1).ravel()
    columns = np.tile(nodes, nodes.shape[1]).ravel()
    return csr_array((local.ravel(), (rows, columns)), shape=(count, count))


@cache
def lumped_shares(k: int, order: int) -> Array:
    """Compute shares (n,) of mass of a cell of k dimensions that its nodes have when it is lumped.

    The diagonal of the consistent mass, scaled to the mass of the cell (Hinton, Rock, Zienkiewicz
    1976, Earthq. Eng. Struct. Dyn. 4): for linear cells the sums of its rows.
    """
    diagonal = np.diag(_consistent(k, order))
    shares: Array = diagonal / diagonal.sum()
    return shares


@cache
def lumping_range(k: int, order: int) -> tuple[float, float]:
    """Bound the ratio of lumped to consistent kinetic energy of a cell of k dimensions.

    The consistent mass of a linear simplex is (I + 11ᵀ)/((k + 1)(k + 2)) of its mass and the
    lumped one I/(k + 1): they differ by 1, for a velocity that is uniform, to k + 2, where its
    nodal values sum to zero. A body of such cells lies between its cells.
    """
    root = np.diag(1.0 / np.sqrt(lumped_shares(k, order)))
    ratios = 1.0 / np.linalg.eigvalsh(root @ _consistent(k, order) @ root)
    return float(ratios.min()), float(ratios.max())


def _consistent(k: int, order: int) -> Array:
    """Make the mass (n, n) of a cell of mass 1."""
    place, share = simplex_rule(k, 2 if order == 1 else 4)
    hats = shape_functions(place, k, order)
    matrix: Array = hats.T @ (share[:, None] * hats)
    return matrix


def _sizes(nodes: NDArray[np.int64], corners: Array) -> tuple[Array, Array]:
    """Compute the diameter (m,) of each cell, and of the largest that shares a node with it, m."""
    edges = corners[:, :, None] - corners[:, None, :]
    size = np.linalg.norm(edges, axis=3).max(axis=(1, 2))
    largest = np.zeros(nodes.max() + 1)
    np.maximum.at(largest, nodes, size[:, None])
    return size, largest[nodes].max(axis=1)


def _along_cuts(solution: Solution) -> NDArray[np.bool_]:
    """Tell whether cells (m,) have a node whose place another node has too, or a point of a cut."""
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    near = 10 * ROUND_OFF * size
    tree = cKDTree(solution.points)
    on = np.zeros(len(solution.points), dtype=bool)
    on[tree.query_pairs(near, output_type="ndarray").ravel()] = True
    if len(solution.cut_facets):
        places = np.unique(solution.cut_facets.reshape(-1, solution.dimension), axis=0)
        found = tree.query(places, distance_upper_bound=near)[1]
        on[found[found < len(on)]] = True
    return on[solution.cells].any(axis=1)


_ALIKE = 0.01  # of the body's size: centres this close in a direction are ordered by the next one


@dataclass(frozen=True)
class Part:
    """A connected piece of material, undeformed (2D: per metre of thickness).

    Parameters
    ----------
    cells : (c,) int array
        Numbers of its cells.
    mass : float
        kg.
    centre : (d,) float array
        Of mass, m.
    inertia : (1,) or (3,) float array
        Moments of inertia about the axes z, in space x, y, z, through its own centre, kg m².
    """

    cells: Ints
    mass: float
    centre: Array
    inertia: Array


def separated_parts(solution: Solution, density: float | Array) -> list[Part]:
    """Find parts of a solution, from the top down (in the plane by y, in space by z; then by y, x).

    Cells are one part if a chain of facets leads from one to the other of which neighbours share
    the nodes: nodes are doubled where a cut separates. Parts that touch in a point, or in space
    in a line, are two.

    Parameters
    ----------
    solution : Solution
    density : float or (m,) array
        kg/m³, of a membrane times its thickness; of all cells of the solution or of each.
    """
    shape = cells_of(solution)
    mass = density * shape.volume
    parts = [_part(cells, shape.corners, mass) for cells in _connected(solution)]
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))

    def place(part: Part) -> tuple[float, ...]:
        return tuple(-np.round(part.centre[::-1] / (_ALIKE * size)))

    return sorted(parts, key=place)


@kept_with
def _connected(solution: Solution) -> list[Ints]:
    """Find cells of each part."""
    cells = solution.cells[:, : solution.cell_dimension + 1]
    label = connected_cells(cells)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def part_of(solution: Solution, density: float | Array, cells: Ints) -> Part:
    """Compute the mass and inertia of given cells (c,), connected or not."""
    shape = cells_of(solution)
    return _part(cells, shape.corners, density * shape.volume)


def boundary_facets(solution: Solution) -> tuple[Ints, Ints]:
    """Find the cells (b,) and opposite corners (b,) of facets of the outer boundary.

    On the faces of a cut two facets have the same place; on the outer boundary each is alone.
    """
    facets, cell, opposite = alone(solution.cells[:, : solution.cell_dimension + 1])
    middle = solution.points[facets].mean(axis=1)
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    near = cKDTree(middle).query(middle, k=2, distance_upper_bound=10 * ROUND_OFF * size)[0]
    outside = ~np.isfinite(near[:, 1])
    return cell[outside], opposite[outside]


def _part(cells: Ints, corners: Array, mass: Array) -> Part:
    own, at = mass[cells], corners[cells]
    total = float(own.sum())
    centre = own @ at.mean(axis=1) / total if total > 0.0 else at.mean(axis=(0, 1))
    # ∫ x xᵀ over a simplex of n corners, per volume: (Σ x_v x_vᵀ + Σ x_v Σ x_vᵀ)/(n (n + 1))
    away = at - centre
    count = at.shape[1]
    whole = away.sum(axis=1)
    square = (away**2).sum(axis=1) + whole**2
    second = own @ square / (count * (count + 1))  # ∫ ρ x_i² (d,)
    d = len(second)
    inertia = np.array([second.sum()]) if d == 2 else second.sum() - second
    return Part(cells, total, np.asarray(centre), inertia)


_WRONG = 0.01  # of the body's mass: beyond, a declared mass belongs to another body
_NOTHING = 1e-9  # of the largest kinetic energy of a motion


@dataclass(frozen=True)
class Inertia:
    """Kinetic energy over the output times, and the mass under gravity.

    Parameters
    ----------
    kinetic : (t,) array
        J (2D: per metre, as all that follows).
    width : (t,) array
        Half-width of its interval, J.
    weights : (n,) array
        Mass at the nodes, kg.
    moment : (t, d) array
        Half-width of Σ weights × displacements, kg m.
    matrix : (n, n) sparse array
        Mass of the nodes, kg.
    off : float
        Relative error of the mass, lumping apart.
    lumped : (n, n) sparse array or None
        Another mass that it may as well be, kg.
    note : str
        Which mass it is.
    """

    kinetic: Array
    width: Array
    weights: Array
    moment: Array
    matrix: csr_array
    note: str
    off: float = 0.0
    lumped: csr_array | None = None


def inertia_of(
    solution: Solution, density: float | Array, whole: Kinetic, parts: Sequence[Part]
) -> Inertia:
    """Take the declared mass of a solution, or the mass of its field if it has none or is wrong.

    A declared mass must have the total, the first moments and the share of each separated part of
    the body. Its kinetic energy at all output times must be within the effect of lumping on the
    kinetic energy of the field. Cut cells may have less: the mass of a part of one acts at the
    centre of the whole cell. So the lower bound decreases by the size of a cell.

    Parameters
    ----------
    solution : Solution
        With velocities.
    density : float or (m,) array
        kg/m³, of each cell.
    whole : Kinetic
        Of the field of the solution.
    parts : sequence of Part
        All separated parts.
    """
    known = np.zeros_like(whole.energy), np.zeros((len(whole.energy), solution.dimension))
    consistent = consistent_mass(solution, density)
    weights = np.asarray(consistent.sum(axis=1)).ravel()
    if isinstance(solution.mass, str):
        assert solution.mass == CONSISTENT
        note = "the consistent mass, as declared"
        return Inertia(whole.energy, known[0], weights, known[1], consistent, note)
    wrong = "no mass is declared"
    if solution.mass is not None:
        own_mass, velocity = solution.mass, solution.velocity
        assert velocity is not None
        matrix = csr_array(
            own_mass if issparse(own_mass) else diags_array(np.asarray(own_mass, float))
        )
        own = np.asarray(matrix.sum(axis=1)).ravel()
        energy = np.array([0.5 * float(np.sum(v * (matrix @ v))) for v in velocity])
        off = _off(solution, own, weights, parts)
        wrong = _outside(solution, energy, whole)
        if off > _WRONG:
            wrong = f"its total, first moments or parts are off by {off:.2g} of the body's mass"
        if not wrong:
            moved = solution.displacement - solution.displacement[0]
            moment = off * np.abs(np.einsum("n,tna->ta", own, moved))
            width = off * energy + _round_off(velocity, matrix)
            return Inertia(energy, width, own, moment, matrix, "the declared mass", off)
        wrong = f"the declared mass is not taken: {wrong}"
    width, moment = _lumping(solution, density)
    note = f"that of the field, give or take its lumping ({wrong})"
    lumped = csr_array(diags_array(weights))
    return Inertia(whole.energy, width, weights, moment, consistent, note, lumped=lumped)


def _round_off(velocity: Array, matrix: csr_array) -> Array:
    """Bound the error (t,) of kinetic energies by round-off: in thin pieces large terms cancel."""
    sizes = np.abs(velocity)
    products = np.array([float(np.sum(v * (abs(matrix) @ v))) for v in sizes])
    return 4.0 * np.finfo(float).eps * products


def _off(solution: Solution, own: Array, weights: Array, parts: Sequence[Part]) -> float:
    """Compare nodal masses with the body in total, moments and parts: largest relative error."""
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    more = own - weights
    off = [abs(more.sum()), float(np.abs(more @ solution.points).max()) / size]
    belongs = [np.unique(solution.cells[part.cells]) for part in parts]
    shared = np.bincount(np.concatenate(belongs), minlength=len(own)) > 1  # by a corner alone
    off += [abs(more[nodes].sum()) for nodes in belongs if not shared[nodes].any()]
    return max(off) / float(weights.sum())


def _outside(solution: Solution, energy: Array, whole: Kinetic) -> str:
    """Say why kinetic energies belong to no lumping, if they do not."""
    corners = cells_of(solution).corners
    largest = float(np.linalg.norm(np.ptp(corners, axis=1), axis=1).max())
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    low, high = lumping_range(solution.cell_dimension, solution.order)
    nothing = _NOTHING * float(np.max([energy, whole.energy]))
    below = energy < low * (1 - largest / size) * whole.energy - nothing
    above = energy > high * whole.energy + nothing
    if not (below | above).any():
        return ""
    at = int(np.flatnonzero(below | above)[0])
    ratio = energy[at] / max(whole.energy[at], 1e-300)
    return (
        f"its kinetic energy at {solution.times[at]:.4g} s is {ratio:.3g} times that of the field, "
        f"and lumping makes {low:.3g} to {high:.3g} of it"
    )

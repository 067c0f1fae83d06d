"""Measurements behind the claims from the literature, one function per claim.

Each returns its numbers in the order of the limits in `claims.toml`, which it does not know.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from verify.conformance.scenes import held, pull, unit_scene, weight
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.convergence import observed_rate
from verify.judge.intervals import quotient_half_width
from verify.judge.models import changed, on_one_level
from verify.printable import words_of
from verify.result import Metric
from verify.scene import Scene, load_scene, load_scenes, scene_content
from verify.simulator.thesis import (
    SPEEDS,
    TETRAHEDRA,
    FaceCount,
    count_face,
    count_strips,
    delays,
    shape_left,
)
from verify.solution import Solution
from verify.solvers.body_of_scene import background_mesh, cuts_of
from verify.study.measured_scenes import measured_scene, measured_solve, variant_of
from verify.system import critical_step, lowest_frequency, with_uncut_twin

Array = NDArray[np.float64]
Cut = tuple[Array, NDArray[np.int64], Array, Array]  # points, cells, point and normal of a plane
_GRAVITY = 9.81
_ELASTIC = {"young": 1.0e4, "poisson": 0.3, "density": 1000.0}
_FAMILIES = ("slivers/plane_edges", "slivers/space_faces")
_SLIVER = "slivers/plane_edges[epsilon=0.01]"
_SMOOTH, _TIPS = "statics/f3_inclined", "statics/griffith_inside"
_L2, _ENERGY = "displacement_l2", "energy_norm"
# Exact fields: cuts through, straight and curved, and ends inside, in the plane and in space, on
# levels where a solve takes about a second, as in the study of positions.
_PLACED = {
    _SMOOTH: 1,
    "curved/circle": 1,
    "benchmark/c1_slit": 1,
    "benchmark/c4_disc": 1,
    "fracture/straight_front": 0,
}
_POSITIONS = 8  # the first of 16, of which few in a row are alike


@dataclass(frozen=True)
class Number:
    """A measured number with the bounds of its true value.

    Attributes
    ----------
    value, low, high : float or None
        None if it could not be measured.
    note : str
        Range over what was varied; or why there is no value.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    note: str = ""


def exactly(value: float, note: str = "") -> Number:
    """Return a number that is known to more digits than a limit has."""
    return Number(float(value), float(value), float(value), note)


def within(value: float, width: float, note: str = "") -> Number:
    """Return a number with its half-width."""
    return Number(float(value), float(value - width), float(value + width), note)


def _extreme(values: Sequence[float], pick: Callable[..., float], note: str) -> Number:
    return exactly(pick(values), f"{min(values):.3g} to {max(values):.3g} over {note}")


def _or_reason(measure: Callable[[], Number]) -> Number:
    """Measure; a program that is absent or refuses gives its reason."""
    try:
        return measure()
    except Exception as problem:  # a guest may raise anything
        return Number(None, note=words_of(problem))


@cache
def _solved(case: str, method: str, level: int) -> tuple[Solution, dict[str, Metric]]:
    """Solve one level of a case by a method and compare with its exact solution."""
    scene, variant = load_scene(case), variant_of(method)
    solution = variant.found().solve(scene, level, repetitions=1, **variant.parameters)
    measured = measured_solve(scene, variant.solver, level, solution)
    return solution, {metric.name: metric for metric in measured.metrics}


def _quotient(one: Metric, other: Metric) -> Number:
    parts = one.value, one.uncertainty, other.value, other.uncertainty
    return within(one.value / other.value, quotient_half_width(*parts))


@cache
def _shares(family: str, method: str) -> list[float]:
    """Critical steps over the uncut body's, for every sliver of a family."""
    variant, found = variant_of(method), []
    for scene in load_scenes(family):
        if scene.row is None or scene.row.value <= 0.0:
            continue
        system: Any = getattr(variant.found(), "system", None)
        try:
            own, whole = with_uncut_twin(system, scene, 0, variant.parameters)
        except UnsupportedSceneError:
            continue
        found.append(critical_step(own) / critical_step(whole))
    return found


def _least_over_slivers(method: str) -> Number:
    found = [share for family in _FAMILIES for share in _shares(family, method)]
    return _extreme(found, min, f"ε = 0.5 to 1e-12 in {' and '.join(_FAMILIES)}")


def _lame(young: float, poisson: float) -> tuple[float, float]:
    """λ and μ in space and in plane strain, Pa."""
    shear = young / (2.0 * (1.0 + poisson))
    return 2.0 * shear * poisson / (1.0 - 2.0 * poisson), shear


def _given(
    folder: Path, points: Array, cells: NDArray[np.int64], at: Array, normal: Array
) -> Scene:
    """Make a scene of a given mesh, cut through by the plane through a point."""
    dim = points.shape[1]
    kind = "triangle" if dim == 2 else "tetra"
    spatial = np.pad(points, ((0, 0), (0, 3 - dim)))
    meshio.Mesh(spatial, [(kind, cells)]).write(folder / "mesh.vtu", file_format="vtu")
    along = 4.0 * np.linalg.svd(normal[None])[2][1:] * np.ptp(points)
    corners = [at + sign * along[0] for sign in (-1.0, 1.0)]
    if dim == 3:
        corners = [at + along.T @ way for way in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return unit_scene(
        "given", folder / "given.toml",
        geometry={"kind": "file", "file": "mesh.vtu", "dimension": dim},
        mesh={"pattern": "given"},
        analysis={"kind": "dynamic", "duration": 1.0, "time_step": 0.01, "outputs": 2},
        material=_ELASTIC | ({"plane": "strain"} if dim == 2 else {}),
        cuts=[{"kind": "polyline" if dim == 2 else "polygon",
               "points": [one.tolist() for one in corners]}],
    )  # fmt: skip


def _steps(
    points: Array, cells: NDArray[np.int64], at: Array, normal: Array, method: str = "xfem"
) -> tuple[float, float]:
    """Critical steps of a given mesh, s: cut through by a plane, and whole."""
    variant = variant_of(method)
    with TemporaryDirectory() as folder:
        scene = _given(Path(folder), points, cells, at, normal)
        system: Any = getattr(variant.found(), "system")  # noqa: B009
        pair = with_uncut_twin(system, scene, 0, variant.parameters)
    return critical_step(pair[0]), critical_step(pair[1])


def _least_over_bodies(method: str) -> Number:
    bodies = list(_bodies())
    ratios = [np.divide(*_steps(*body, method)) for body in bodies]
    return _extreme(ratios, min, f"{len(bodies)} cut bodies")


def element_step(points: Array, cells: NDArray[np.int64]) -> float:
    """Least critical step of the uncut elements alone, each with its mass lumped, s.

    Parameters
    ----------
    points : (n, d) float array
        m; of triangles in plane strain, or of tetrahedra.
    cells : (m, d + 1) int array
    """
    lame, shear = _lame(_ELASTIC["young"], _ELASTIC["poisson"])
    least = np.inf
    for corners in points[cells]:
        count, dim = corners.shape
        slopes = np.linalg.inv(np.column_stack([np.ones(count), corners]))[1:].T
        pairs = np.einsum("ik,jl->ikjl", slopes, slopes)
        dots = np.einsum("ij,kl->ikjl", slopes @ slopes.T, np.eye(dim))
        matrix = lame * pairs + shear * (pairs.swapaxes(1, 3) + dots)
        matrix = matrix.reshape(count * dim, count * dim) * count / _ELASTIC["density"]
        least = min(least, 2.0 / np.sqrt(np.linalg.eigvalsh(matrix)[-1]))
    return float(least)


def _simplices(count: int = 10) -> Iterator[Cut]:
    """Single triangles and tetrahedra, and planes through a random inner point of each."""
    random = np.random.default_rng(0)
    for dim in (2, 3):
        for _ in range(count):
            points = random.normal(size=(dim + 1, dim))
            inside = random.dirichlet(np.ones(dim + 1)) @ points
            yield points, np.arange(dim + 1, dtype=np.int64)[None], inside, random.normal(size=dim)


def _bodies(count: int = 6) -> Iterator[Cut]:
    """Squares and cubes with inner nodes moved by up to a sixth of an element, and planes."""
    random = np.random.default_rng(1)
    for dim in (2, 3):
        box = {"kind": "box", "lower": [0.0] * 3, "upper": [1.0] * 3}
        given: dict[str, Any] = {"geometry": box, "material": _ELASTIC} if dim == 3 else {}
        supports = [held("bottom", [0.0] * dim)]
        grid = unit_scene("grid", mesh={"cells": [[4] * dim]}, supports=supports, **given)
        mesh, size = background_mesh(grid, 0)
        inner = ((mesh.points > 1e-9) & (mesh.points < 1.0 - 1e-9)).all(axis=1)
        for _ in range(count):
            moved = random.uniform(-1.0, 1.0, mesh.points.shape) * size / 6.0
            middle = random.uniform(0.3, 0.7, dim)
            points = mesh.points + inner[:, None] * moved
            yield points, np.asarray(mesh.cells), middle, random.normal(size=dim)


def uncut_step() -> list[Number]:
    """Compare steps with the side-wise mass: one element, bodies, the smallest element."""
    singles = [np.divide(*_steps(*one)) for one in _simplices()]
    off = [abs(ratio - 1.0) for ratio in singles]
    bodies = list(_bodies())
    steps = [_steps(*body) for body in bodies]
    least = [own / element_step(*b[:2]) for b, (own, _) in zip(bodies, steps, strict=True)]
    return [
        _extreme(off, max, f"{len(off)} cut triangles and tetrahedra"),
        _least_over_slivers("xfem"),
        _extreme([own / whole for own, whole in steps], min, f"{len(steps)} cut bodies"),
        _extreme(least, min, "the same bodies"),
    ]


def diagonal_step() -> list[Number]:
    """Compare steps with the diagonal mass of the thesis (2.80), after Menouillard et al. 2006."""
    ratios = [np.divide(*_steps(*one, "xfem mass=thesis")) for one in _simplices()]
    return [
        _extreme(ratios, min, f"{len(ratios)} cut triangles and tetrahedra"),
        _least_over_slivers("xfem mass=thesis"),
    ]


def fewer_unknowns() -> list[Number]:
    """Compare unknowns with a mesh made anew for the cut, at equal error around crack tips."""

    def curve(method: str, metric: str) -> Array:
        rows = [_solved(_TIPS, method, level) for level in range(3)]
        return np.log([(solution.unknowns, found[metric].value) for solution, found in rows]).T

    def compared(method: str, metric: str) -> Number:
        own, other = (curve(name, metric) for name in (method, "conforming mesh=remeshed"))
        ratios = [_unknowns_at(other, error, size) for size, error in own.T[1:]]
        return Number(ratios[-1], min(ratios), max(ratios), "on the two finest of three levels")

    return [
        _or_reason(partial(compared, method, metric))
        for method in ("getfem tip=functions", "xfem")
        for metric in (_L2, _ENERGY)
    ]


def _unknowns_at(other: Array, error: float, size: float) -> float:
    """Unknowns e^size over those at which the other curve (unknowns, errors; logs) has an error."""
    slope, offset = np.polyfit(other[0], other[1], 1)
    return float(np.exp(size - (error - offset) / slope))


def blade() -> list[Number]:
    """Energy that an opening at once makes or loses, and its share that leaves the body."""
    found = _solved("benchmark/c5_blade_03", "xfem opening=late", 1)[1]
    drift, waves = found["energy_drift"], found["released_to_kinetic"]
    return [
        exactly(drift.value, "of the energy in play"),
        exactly(waves.value / found["released"].value),
    ]


def gradual_release() -> list[Number]:
    """Let forces fade behind a blade, and open at once: errors of K_III, energy that is taken."""
    case = "benchmark/c5_blade_03"
    once, faded = (_solved(case, f"xfem opening={rule}", 1)[1] for rule in ("late", "swept"))
    off = [abs(one["K_III"].value / (one["K_III"].reference or 1.0) - 1.0) for one in (once, faded)]
    return [
        exactly(off[1] / off[0], f"relative errors {off[1]:.2g} and {off[0]:.2g}"),
        exactly(faded["released_to_cut"].value / faded["released"].value),
    ]


def stabilised_mass() -> list[Number]:
    """Least steps with masses that eigenvalues stabilise, and with the plain consistent mass."""
    gevs, evs, plain = (
        _least_over_slivers(f"xfem mass={name}") for name in ("gevs", "evs", "consistent")
    )
    return [gevs, exactly((evs.value or 0.0) / (plain.value or 1.0), f"EVS {evs.value:.3g}")]


def ghost_locks() -> list[Number]:
    """Errors with a ghost penalty of a large and of the default factor, and aggregated cells."""
    content = scene_content(load_scene(_SLIVER))

    def error(method: str) -> float:
        rows = {m.quantity: m for m in measured_scene(method, content)}
        if _L2 not in rows:
            raise InputError("; ".join(m.reason for m in rows.values()))
        return rows[_L2].value or 0.0

    fitted = error("conforming")
    large = partial(lambda: exactly(error("ngsxfem ghost=100000") / error("ngsxfem ghost=0.01")))
    return [_or_reason(large), exactly(error("xfem slivers=merge") / fitted)]


def virtual_nodes() -> list[Number]:
    """Least steps with virtual nodes, and with cells divided along the cut."""
    return [
        _least_over_slivers("virtual_node"),
        _least_over_bodies("virtual_node"),
        _least_over_slivers("subdivision"),
    ]


def open_question() -> list[Number]:
    """Step, and order of the frequency error, of the side-wise mass on linear simplices."""
    scene, variant = load_scene(_SLIVER), variant_of("xfem")
    sizes, errors = (8, 16, 32), []
    for n in sizes:
        mesh = scene.mesh.model_copy(update={"cells": ((n, n),)})
        own = scene.model_copy(update={"mesh": mesh})
        lumped, plain = (
            lowest_frequency(variant.found().system(own, 0, mass=mass))  # type: ignore[attr-defined]
            for mass in ("sidewise", "consistent")
        )
        errors.append(abs(lumped / plain - 1.0))
    order = np.log2(errors[-2] / errors[-1])
    shown = ", ".join(f"{error:.2g}" for error in errors)
    return [
        _least_over_slivers("xfem"),
        exactly(order, f"distances {shown} at h = 1/8, 1/16, 1/32"),
    ]


def optimal_rates() -> list[Number]:
    """Observed orders in L² and energy norm: smooth field, and halves that bend to half circles."""
    found = []
    for case in (_SMOOTH, "rotation/peeled_halves"):
        rows = [_solved(case, "xfem", level) for level in range(3)]
        sizes = [solution.size for solution, _ in rows]
        for name in (_L2, _ENERGY):
            metrics = [row[1][name] for row in rows]
            errors, widths = [m.value for m in metrics], [m.uncertainty for m in metrics]
            rate = observed_rate("xfem", name, sizes, errors, widths)
            unknown = Number(None, note=rate.reason)
            found.append(unknown if rate.order is None else within(rate.order, rate.uncertainty))
    return found


def error_control() -> list[Number]:
    """Estimates by recovered strains over true errors in the energy norm, on exact scenes."""
    found = []
    for method in ("conforming", "xfem"):
        shares = []
        for case in (_SMOOTH, _TIPS, "curved/circle"):
            scene = load_scene(case)
            for level in range(2):
                solution, metrics = _solved(case, method, level)
                norm = np.sqrt(2.0 * (metrics["strain_energy"].reference or 0.0))
                lame = _lame(scene.material.young, scene.material.poisson)
                estimate = recovered_error(solution, *lame)
                shares.append(estimate / (norm * metrics[_ENERGY].value))
        found += [_extreme(shares, min, "three scenes on two levels")]
        found += [exactly(float(np.median(shares)))]
    return found


def recovered_error(solution: Solution, lame: float, shear: float) -> float:
    """Estimate the error of linear triangles in the energy norm from averaged strains.

    Zienkiewicz and Zhu (1987): strains averaged at nodes and interpolated linearly, less the
    strains of the cells. Nodes of the two faces of a cut are averaged apart.

    Parameters
    ----------
    solution : Solution
        Plane, of order 1.
    lame, shear : float
        Of the plane problem, Pa.

    Returns
    -------
    float
        √∫ σ:ε of the difference, √J (per metre of thickness).
    """
    cells, corners = solution.cells, solution.points[solution.cells]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    moved = solution.displacement[-1][cells]
    gradient = np.swapaxes(moved[:, 1:] - moved[:, :1], 1, 2) @ np.linalg.inv(edges)
    strain = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    area = 0.5 * np.abs(np.linalg.det(edges))
    share, total = np.zeros(len(solution.points)), np.zeros((len(solution.points), 2, 2))
    np.add.at(share, cells, area[:, None])
    np.add.at(total, cells, (area[:, None, None] * strain)[:, None])
    off = (total / np.where(share > 0.0, share, 1.0)[:, None, None])[cells] - strain[:, None]

    def products(d: Array) -> Array:
        return lame * np.trace(d, axis1=-2, axis2=-1) ** 2 + 2.0 * shear * (d**2).sum(axis=(-2, -1))

    # ∫ of the square of a linear field over a triangle: A/12 (Σ d_i² + (Σ d_i)²)
    squares = area / 12.0 * (products(off).sum(axis=1) + products(off.sum(axis=1)))
    return float(np.sqrt(squares.sum()))


def hanging_bar(cells_of_mass: bool) -> Scene:
    """Make the bar of Newton's test: 0.2 × 0.2 × 1 m, μ = λ = 5e4 Pa, 4 × 4 × 20 cells, held above.

    A cell's mass at every vertex makes each layer 25/16 times as heavy, and the lowest twice that.
    So gravity is larger, and a traction pulls at the lower end.
    """
    more = 25.0 / 16.0 if cells_of_mass else 1.0
    loads = [weight(0.0, 0.0, -more * _GRAVITY)]
    if cells_of_mass:
        loads.append(pull("bottom", 0.0, 0.0, -more * _GRAVITY * 1000.0 * 0.025))
    return unit_scene(
        "bar",
        geometry={"kind": "box", "lower": [0.0, 0.0, 0.0], "upper": [0.2, 0.2, 1.0]},
        mesh={"cells": [[4, 4, 20]]},
        material={"young": 1.25e5, "poisson": 0.25, "density": 1000.0,
                  "model": "stable_neo_hookean"},
        analysis={"kinematics": "finite_rotation"},
        supports=[held("top", [0.0, 0.0, 0.0])],
        loads=loads,
    )  # fmt: skip


def extension(cells_of_mass: bool, method: str = "xfem") -> float:
    """Mean displacement of the lower end of the hanging bar, downwards, m."""
    variant = variant_of(method)
    scene = hanging_bar(cells_of_mass)
    solution = variant.found().solve(scene, 0, repetitions=1, **variant.parameters)
    return float(-solution.displacement[-1, solution.points[:, 2] == 0.0, 2].mean())


def vbd_bar() -> list[Number]:
    """Compare baselines of Newton's test, and a run of its solver, with the equilibrium."""
    linear = 525 * 1000.0 * 0.05**3 * 9.81 / (2.0 * 0.04 * 1.25e5)
    heavy, true = extension(True), extension(False)
    solver = partial(lambda: exactly(extension(False, "vbd iterations=100") / true,
                                     f"equilibrium {true:.5f} m"))  # fmt: skip
    return [
        exactly(0.0999 / heavy, f"equilibrium {heavy:.5f} m with their masses"),
        exactly(heavy / linear, f"{linear:.5f} m by their formula"),
        _or_reason(solver),
    ]


@cache
def _face() -> FaceCount:
    return count_face((1000,))[-1]


def half_the_unknowns() -> list[Number]:
    """Nodes that XFEM adds on the face over the count of snapping and subdivision."""
    last = _face().added
    ratios = {n.split()[1]: last["xfem"] / c for n, c in last.items() if n.startswith("snapping_")}
    return [exactly(ratios["0.02"]), _extreme(list(ratios.values()), max, "six thresholds")]


def added_nodes() -> list[Number]:
    """Nodes that XFEM adds to cut strips, and on the face."""
    strips, face = count_strips((1, 2, 3, 7, 50, 500)), _face()
    off = [abs(strip.enriched - strip.triangles - 2) for strip in strips]
    added = face.added["xfem"]
    return [
        exactly(max(off), f"{len(off)} strips"),
        exactly(added / face.cuts, f"{added} nodes, {face.cuts} cut elements"),
    ]


def size_over_speed() -> list[Number]:
    """Delays times speed over the edge, here; the thesis' delays beside the law."""
    rows = delays(TETRAHEDRA)
    size = [row.delay * row.speed / row.edge for row in rows]
    spread = exactly(max(size) / min(size) - 1.0, f"{min(size):.3f} to {max(size):.3f} of an edge")
    columns = [[row for row in rows if row.speed_name == name] for name in SPEEDS]
    law = columns[0][-1].delay / columns[0][0].delay
    falls = [column[-1].thesis / column[0].thesis for column in columns]
    off = max(abs(fall / law - 1.0) for fall in falls)
    said = ", ".join(f"{fall:.2f}" for fall in falls)
    return [spread, exactly(off, f"to {said} of the coarsest mesh's, size over speed to {law:.2f}")]


def stable_and_accurate() -> list[Number]:
    """Measure the least steps, and errors over the errors of a mesh that conforms to the cut."""
    found = [_least_over_slivers("xfem"), _least_over_bodies("xfem")]
    for case, level in _PLACED.items():
        found += _over_positions(case, level)
    return found


def _over_positions(case: str, level: int) -> list[Number]:
    """Errors of XFEM over a conforming mesh's in both norms: median and ends over positions."""
    ratios = []
    for number in range(_POSITIONS):
        update = {"mesh": {"position": number}, "quantities": [{"kind": "strain_energy"}]}
        scene, errors = changed(on_one_level(load_scene(case), level), "", update), []
        for name in ("xfem", "conforming"):
            solution = variant_of(name).found().solve(scene, 0, repetitions=1)
            measured = measured_solve(scene, name, 0, solution)
            own = {metric.name: metric.value for metric in measured.metrics}
            errors.append(np.array([own[_L2], own[_ENERGY]]))
        ratios.append(errors[0] / errors[1])
    note = f"median and ends of {_POSITIONS} positions of the mesh"
    return [
        Number(float(np.median(own)), float(min(own)), float(max(own)), note)
        for own in np.transpose(ratios)
    ]


def snapping() -> list[Number]:
    """Shapes of elements whose nodes were moved onto the cut, over the uncut mesh's; steps."""
    slivers = [
        _snapped_shape(scene)
        for family in _FAMILIES for scene in load_scenes(family)
        if scene.row is not None and scene.row.value > 0.0
    ]  # fmt: skip
    bodies = []
    for body in _bodies(60):  # the least shape of a few says little, and a shape costs no solve
        with TemporaryDirectory() as folder:
            bodies.append(_snapped_shape(_given(Path(folder), *body)))
    face = _face()
    return [
        _extreme(slivers, min, f"ε = 0.5 to 1e-12 in {' and '.join(_FAMILIES)}"),
        _extreme(bodies, min, f"{len(bodies)} cut bodies"),
        exactly(face.shape["snapping"], f"{face.cuts} cut elements"),
        _least_over_slivers("snapping"),
        exactly(face.step["snapping"], f"{face.cuts} cut elements"),
    ]


def _snapped_shape(scene: Scene) -> float:
    """Least shape of a snapped mesh over the given mesh's."""
    mesh, size = background_mesh(scene, 0)
    return shape_left("snapping", mesh, cuts_of(scene, size))


def removal() -> list[Number]:
    """Area that removal takes out of the body, on the finest of three meshes, and its order."""
    lost = []
    for level in range(3):
        solution, _ = _solved(_SMOOTH, "removal", level)
        corners = solution.points[solution.cells]
        lost.append(1.0 - 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum())
    shown = ", ".join(f"{share:.2g}" for share in lost)
    return [exactly(lost[-1], f"{shown} on three meshes"), exactly(np.log2(lost[-2] / lost[-1]))]


def springs() -> list[Number]:
    """L² errors of springs in a state of uniform strains: on a fine mesh, and over a coarse one."""
    case = "statics/f1_patch"
    errors = [_solved(case, "mass_spring fit=van_gelder", k)[1][_L2] for k in range(2)]
    note = f"{errors[0].value:.2g} and {errors[1].value:.2g} at h = 1/8 and 1/16"
    return [within(errors[1].value, errors[1].uncertainty, note), _quotient(errors[1], errors[0])]


def measured(names: list[str]) -> dict[str, list[Number]]:
    """Measure claims one after the other, which share solves.

    Parameters
    ----------
    names : list of str
        Functions of this module.

    Returns
    -------
    dict of str to list of Number
        One number with the reason where a measurement failed.
    """
    found = {}
    for name in names:
        try:
            found[name] = globals()[name]()
        except Exception as problem:  # a guest may raise anything
            found[name] = [Number(None, note=words_of(problem))]
    return found

"""Rules for the ends of cuts, on many meshes of each of many scenes: docs/theory/xfem.md decides.

``python tests/study/tip_rules.py [--quick]`` prints the tables of docs/guide/studies.md: a tenth
of it in half a minute, or all of it.
"""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from reference.exact import exact_of
from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.compare.realised import field_of
from verify.judge.quantities import Measured
from verify.scene import Scene
from verify.solvers import find_solver
from verify.solvers import xfem as adapter
from verify.solvers.body_of_scene import cuts_of, material_of, to_cut
from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import PolygonPatch, Polyline
from verify.xfem.explicit import critical_step
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import simplex_rule
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

RULES = {2: ("inside", "through", "nearest", "partial"), 3: ("inside", "through", "nearest")}
DIVISIONS = {2: 16, 3: 6}
MOVED = 0.2  # of an element
ADVANCE = 1 / 8  # elements per step of a moving tip
STEPS = 16
TOLERANCE = 0.25  # of an error above the error of `inside`, in any scene
NU, YOUNG = 0.3, 1.0


def scene_of(name, half, **content):
    """A scene on the square or cube of half-width `half`, m."""
    dimension = 3 if "box" in name else 2
    content = {
        "schema": 1, "title": name, "requirement": "Ends of cuts shall be measured.",
        "geometry": {
            "kind": "box" if dimension == 3 else "rectangle",
            "lower": [-half] * dimension, "upper": [half] * dimension,
        },
        "mesh": {"cells": [[DIVISIONS[dimension]] * dimension]},
        "material": {"young": YOUNG, "poisson": NU}
        | ({"plane": "strain"} if dimension == 2 else {}),
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "quantities": [{"kind": "strain_energy"}],
        "acceptance": [],
    } | content  # fmt: skip
    scene = Scene.model_validate(content)
    scene._name, scene._file = name, Path(f"{name}.toml")
    return scene


def exact(solution, **parameters):
    return {"solution": solution, "parameters": parameters}


def line(*points):
    return {"kind": "polyline", "points": [[float(x) for x in point] for point in points]}


def way(degrees):
    return np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])


def griffith(number, stress, angle, centre, a):
    """A crack inside a square whose outline is held, exact."""
    along, middle = a * way(angle), np.array(centre)
    return scene_of(
        f"griffith {number}", 2.0, cuts=[line(middle - along, middle + along)],
        exact=exact("griffith", centre=centre, a=a, angle=angle, stress=stress),
    )  # fmt: skip


def edge(number, intensity, angle, tip):
    """A crack from the left edge into a square whose outline is held, exact."""
    start = np.array(tip) - 3.0 / np.cos(np.deg2rad(angle)) * way(angle)
    return scene_of(
        f"edge {number}", 1.0, cuts=[line(start, tip)],
        exact=exact("tip", tip=tip, angle=angle, intensity=intensity),
    )  # fmt: skip


def arc(number, stress, angle, half_angle, radius):
    cut = {"kind": "arc", "centre": [0.03, -0.02], "radius": radius,
           "start": angle - half_angle, "sweep": 2 * half_angle}  # fmt: skip
    return scene_of(
        f"arc {number}", 2.0, cuts=[cut],
        exact=exact("arc_crack", centre=[0.03, -0.02], radius=radius, angle=angle,
                    half_angle=half_angle, stress=stress),
    )  # fmt: skip


def pulled(number, *cuts):
    """Cuts in a square pulled by rollers above and below: the reference is a conforming mesh."""
    roller = {"displacement": [1.0], "components": ["y"]}
    supports = [
        roller | {"where": "top"},
        roller | {"where": "bottom", "displacement": [-1.0]},
        {"where": "x > 0.999999999 and y < -0.999999999", "displacement": [0.0],
         "components": ["x"]},
    ]  # fmt: skip
    cuts = [line(*points) | {"name": f"cut{k}"} for k, points in enumerate(cuts)]
    return scene_of(
        f"pulled {number}", 1.0, cuts=cuts, supports=supports, reference={"size": 0.125}
    )


def front(number, normal, axis, intensity, point=(0.03, -0.02, 0.04)):
    """A crack in a box up to a straight front."""
    point, normal = np.array(point), np.array(normal) / np.linalg.norm(normal)
    ahead = np.array(axis) - normal * (normal @ np.array(axis))
    ahead /= np.linalg.norm(ahead)
    along = np.cross(normal, ahead)
    corners = [point - 2 * along, point + 2 * along]
    corners += [point + 2 * along - 3 * ahead, point - 2 * along - 3 * ahead]
    cut = {"kind": "polygon", "points": [list(map(float, one)) for one in corners]}
    if np.cross(corners[1] - corners[0], corners[2] - corners[1]) @ normal < 0:
        cut["points"].reverse()
    return scene_of(
        f"box front {number}", 0.5, cuts=[cut],
        exact=exact("straight_front", point=point.tolist(), normal=normal.tolist(),
                    axis=ahead.tolist(), intensity=intensity),
    )  # fmt: skip


def penny(number, normal, stress):
    centre = [0.07, -0.04, 0.03]
    cut = {"kind": "disc", "centre": centre, "normal": normal, "radius": 1.0}
    return scene_of(
        f"box penny {number}", 2.0, cuts=[cut],
        exact=exact("penny", centre=centre, normal=normal, a=1.0, stress=stress),
    )  # fmt: skip


@cache
def plane_scenes():
    """24 scenes, in general position: places and angles are drawn."""
    random = np.random.default_rng(32)
    stresses = ([0.0, 1.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0])
    found = [
        griffith(k, stresses[k % 4], float(random.uniform(-45, 45)),
                 random.uniform(-0.2, 0.2, 2).tolist(), float(random.uniform(0.6, 1.1)))
        for k in range(8)
    ]  # fmt: skip
    found += [
        edge(k, [(1.0, 0.0), (0.0, 1.0), (1.0, 0.7)][k % 3], float(random.uniform(-30, 30)),
             random.uniform(-0.3, 0.3, 2).tolist())
        for k in range(6)
    ]  # fmt: skip
    found += [
        arc(k, [1.0, 1.0, 0.0] if k % 2 else [0.0, 1.0, 0.0], float(random.uniform(0, 360)),
            float(random.uniform(25, 60)), float(random.uniform(0.7, 1.1)))
        for k in range(4)
    ]  # fmt: skip
    found += [
        pulled(0, [(-1.2, 0.033), (-0.13, 0.033)]),
        pulled(1, [(-1.2, -0.31), (0.11, 0.27)]),
        pulled(2, [(-1.2, 0.21), (-0.41, 0.13), (0.07, -0.29)]),
        pulled(3, [(-0.43, -0.13), (0.41, 0.19)], [(0.11, -0.42), (-0.13, 0.43)]),
        pulled(4, [(-0.61, -0.27), (0.09, -0.11)], [(-0.07, 0.23), (0.58, 0.31)]),
        pulled(5, [(-1.2, 0.27), (-0.31, 0.21)], [(1.2, -0.23), (0.29, -0.17)]),
    ]
    return found


@cache
def space_scenes():
    """Six scenes in a box."""
    pull = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    shear = [[0.0, 0.0, 0.4], [0.0, 0.0, 0.0], [0.4, 0.0, 1.0]]
    return [
        front(0, [0.1, 1.0, 0.05], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        front(1, [-11.2, 38.4, 9.0], [0.96, 0.28, 0.0], [1.0, 0.5, -0.7]),
        front(2, [0.3, -0.2, 1.0], [1.0, 0.3, 0.0], [0.0, 0.0, 1.0]),
        front(3, [0.2, 0.9, -0.3], [1.0, -0.2, 0.2], [0.6, 1.0, 0.3]),
        penny(0, [0.36, -0.48, 0.8], pull),
        penny(1, [0.1, 0.2, 1.0], shear),
    ]


def mesh_of(low, high, count, diagonal, seed):
    """A mesh of `count` divisions, inner nodes moved at random if there is a seed; its size, m."""
    size = (high[0] - low[0]) / count
    if len(low) == 3:
        mesh = box_mesh((count,) * 3, low, high)
    else:
        mesh = rectangle_mesh((count,) * 2, low, high, diagonal=diagonal)
    if seed is None:
        return mesh, size
    inner = np.all((mesh.points > low) & (mesh.points < high), axis=1)
    points = mesh.points.copy()
    moves = np.random.default_rng(seed).uniform(-MOVED, MOVED, points.shape) * size
    points[inner] += moves[inner]
    return SimplexMesh(points, mesh.cells), size


def meshes_of(scene):
    """16 meshes of a square, 4 of a box: (mesh, size)."""
    ends = scene.geometry.lower, scene.geometry.upper
    n = DIVISIONS[len(ends[0])]
    if len(ends[0]) == 3:
        return [mesh_of(*ends, *each) for each in (
            (n - 1, "", None), (n, "", 0), (n, "", 1), (n + 1, "", None)
        )]  # fmt: skip
    both = ("right", "left")
    found = [mesh_of(*ends, count, one, None) for count in (n - 1, n, n + 1) for one in both]
    return found + [mesh_of(*ends, n, one, seed) for seed in range(5) for one in both]


def solved(scene, mesh, size, rule, solver="xfem"):
    """Solve a scene on a mesh of our own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(adapter, "background_mesh", lambda *_: (mesh, size))
        return find_solver(solver).solve(scene, 0, 1, tip=rule)


def subdivided(solution):
    """Corners (m, c, d) and measures (m,) of the cells of a solution."""
    corners = solution.points[solution.cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    return corners, volume / (2 if corners.shape[2] == 2 else 6)


def l2_error(solution, truth):
    """‖u − truth‖/‖truth‖, by a rule of degree 6 on the cells of a solution."""
    corners, volume = subdivided(solution)
    values = solution.displacement[-1][solution.cells]
    barycentric, weights = simplex_rule(corners.shape[2], 6)
    at = np.einsum("qk,ckd->cqd", barycentric, corners).reshape(-1, corners.shape[2])
    got = np.einsum("qk,ckd->cqd", barycentric, values).reshape(at.shape)
    want = truth(at)
    weight = (volume[:, None] * weights).ravel()
    return float(np.sqrt(weight @ ((got - want) ** 2).sum(1) / (weight @ (want**2).sum(1))))


def energy_of(solution):
    """∫ ½ σ : ε of linear simplices, J."""
    corners, volume = subdivided(solution)
    edges = corners[:, 1:] - corners[:, :1]
    u = solution.displacement[-1][solution.cells]
    gradient = np.linalg.solve(edges, u[:, 1:] - u[:, :1])
    strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
    shear = YOUNG / (2 * (1 + NU))
    lame = YOUNG * NU / ((1 + NU) * (1 - 2 * NU))
    trace = np.trace(strain, axis1=1, axis2=2)
    return float(volume @ (0.5 * lame * trace**2 + shear * (strain**2).sum(axis=(1, 2))))


@dataclass(frozen=True)
class Truth:
    """Displacement of a scene, its energy, and what the ends release per metre of advance."""

    displacement: object
    energy: float
    release: float


def known(scene):
    """From the closed form, or from a conforming reference: quadratic, graded to the ends."""
    if scene.exact is None:
        solver = find_solver("reference")
        body = body_of(scene)
        found, step = solver.solve(scene, 0, 0), 0.02
        field = field_of(found, body)
        energies = [
            Measured(solver.solve(one, 0, 0), body_of(one), law_of(one), one).quantity(
                one.quantities[0]
            )
            for one in (advanced(scene, -step), scene, advanced(scene, step))
        ]
        release = (energies[0] - energies[2]) / (2 * step)
        return Truth(lambda x: field.displacement(x, x), energies[1], release)
    one = exact_of(scene)
    straight = scene.exact.solution == "straight_front"
    energy = work_on_faces(one, scene) if straight else one.strain_energy(scene)
    return Truth(lambda x: one.displacement(x, x), energy, released(one, scene))


def work_on_faces(one, scene, count=350):
    """½ ∫ σn · u over the faces of a box, by midpoints: to 1e-6 where a cut goes through them."""
    low, high = np.array(scene.geometry.lower), np.array(scene.geometry.upper)
    share = (np.arange(count) + 0.5) / count
    total = 0.0
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for sign, place in ((-1.0, low[axis]), (1.0, high[axis])):
            points = np.empty((count**2, 3))
            points[:, axis] = place
            grid = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
            points[:, others] = low[others] + grid * (high - low)[others]
            pull = sign * one.stress(points, points)[:, :, axis]
            area = np.prod((high - low)[others]) / count**2
            total += 0.5 * area * float((pull * one.displacement(points, points)).sum())
    return total


def advanced(scene, step):
    """The scene with every end of its cuts farther on, along its line."""
    content = scene.model_dump(mode="json", by_alias=True)
    for cut in content["cuts"]:
        points = np.array(cut["points"])
        for end, before in ((0, 1), (-1, -2)):
            out = points[end] - points[before]
            points[end] += step * out / np.linalg.norm(out)
        cut["points"] = points.tolist()
    found = Scene.model_validate(content)
    found._name, found._file = scene.name, scene.file
    return found


def released(one, scene):
    """Σ G over ends, J/m per metre; in space ∫ G along the front inside the box, J/m."""
    modulus, shear = YOUNG / (1 - NU**2), YOUNG / (2 * (1 + NU))

    def rate(k):
        third = k[2] if len(k) == 3 else 0.0
        return (k[0] ** 2 + k[1] ** 2) / modulus + third**2 / (2 * shear)

    name = scene.exact.solution
    if name in ("griffith", "tip"):
        return len(one.singular_points) * rate(one.stress_intensity)
    if name == "arc_crack":
        return sum(rate(one.intensity_at(tip)) for tip in one.singular_points)
    if name == "penny":
        turn = np.linspace(0.0, 2 * np.pi, 64, endpoint=False)
        ring = np.cos(turn)[:, None] * one._axes[0] + np.sin(turn)[:, None] * one._axes[1]
        return 2 * np.pi * one._a * np.mean([rate(one.intensity_at(one._centre + x)) for x in ring])
    places = np.linspace(-2.0, 2.0, 40001)[:, None] * one._axes[2] + one._origin
    inside = np.all(np.abs(places) < 0.5, axis=1).mean() * 4.0
    return inside * rate(one.stress_intensity)


def cut_by(rule, mesh, cuts):
    asked = to_cut(mesh, cuts, rule)
    return cut_mesh(asked.mesh, asked.cuts, asked.rule)


def resisting(scene, mesh, size, rule):
    """Elasticity, and mass of density 1, of the cut body of a scene without supports."""
    phantom = cut_by(rule, mesh, cuts_of(scene, size))
    force = InternalForce(phantom, material_of(scene, mesh), "linear")
    return force, side_wise_mass(phantom, 1.0)


def step_of(force, mass):
    """Critical step of a body without supports, s."""
    pattern = block_pattern(force.phantom.cells, force.phantom.node_count)
    return critical_step(pattern.matrix(force.stiffness(pattern)).tocsr(), mass, tolerance=1e-3)


@dataclass(frozen=True)
class Row:
    """One scene: by rule, root mean square error, mean and scatter of the shift, critical step."""

    name: str
    error: dict
    shift: dict
    scatter: dict
    step: dict


def measured(scene, truth, meshes, timed=4):
    """Solve a scene by all rules on all meshes; the critical step on the last `timed`."""
    found = {key: {} for key in ("error", "shift", "scatter", "step")}
    for rule in RULES[len(scene.geometry.lower)]:
        answers = [(solved(scene, *mesh, rule), mesh[1]) for mesh in meshes]
        errors = [l2_error(one, truth.displacement) for one, _ in answers]
        shifts = [(truth.energy - energy_of(one)) / truth.release / size for one, size in answers]
        found["error"][rule] = float(np.sqrt(np.mean(np.square(errors))))
        found["shift"][rule], found["scatter"][rule] = np.mean(shifts), np.std(shifts)
        steps = [step_of(*resisting(scene, *mesh, rule)) for mesh in meshes[-timed:]]
        found["step"][rule] = float(np.exp(np.mean(np.log(steps))))
    return Row(scene.name, **found)


def grown(scene, by):
    """A Griffith crack with its end, or a straight front, farther on by `by` metres."""
    given = {**scene.exact.parameters}
    number = scene.name.split()[-1]
    if scene.exact.solution == "griffith":
        middle = np.array(given["centre"]) + 0.5 * by * way(given["angle"])
        a = given["a"] + 0.5 * by
        return griffith(number, given["stress"], given["angle"], middle.tolist(), a)
    point = np.array(given["point"]) + by * np.array(given["axis"])
    return front(number, given["normal"], given["axis"], given["intensity"], point)


def jumps(scene, mesh, size):
    """Largest advance of the effective end, in elements, as the cut grows by h/8 per step."""
    rules = RULES[mesh.dim]
    places = {rule: [] for rule in rules}
    for step in range(STEPS + 1):
        longer = grown(scene, step * ADVANCE * size)
        truth = known(longer)
        # both ends of a Griffith crack release alike, and one of them moves
        release = truth.release * (0.5 if mesh.dim == 2 else 1.0) * size
        for rule in rules:
            off = (truth.energy - energy_of(solved(longer, mesh, size, rule))) / release
            places[rule].append(off + step * ADVANCE)
    return {rule: float(np.diff(places[rule]).max()) for rule in rules}


def interval(logs, seed=0, draws=10000):
    """95 % interval of the median of logarithms, resampled over scenes."""
    random = np.random.default_rng(seed)
    picks = random.integers(0, len(logs), (draws, len(logs)))
    return np.exp(np.percentile(np.median(np.asarray(logs)[picks], axis=1), [2.5, 97.5]))


def weighed(rows, dimension):
    """Work of each rule at equal error over the work of `inside`: solves, explicit motions."""
    found = {}
    for rule in RULES[dimension]:
        errors = np.log([row.error[rule] / row.error["inside"] for row in rows])
        steps = np.log([row.step[rule] / row.step["inside"] for row in rows])
        works = {
            "solve": dimension * errors,
            "explicit": (dimension + 1) * errors - steps,
        }
        shift = [row.shift[rule] ** 2 + row.scatter[rule] ** 2 for row in rows]
        found[rule] = {
            "r": float(np.exp(np.median(errors))),
            "worst": float(np.exp(errors.max())),
            "t": float(np.exp(np.median(steps))),
            "mean shift": float(np.median([row.shift[rule] for row in rows])),
            "scatter": float(np.sqrt(np.mean([row.scatter[rule] ** 2 for row in rows]))),
            "shift": float(np.sqrt(np.mean(shift))),
            "works": works,
        }
    return found


def parts(rule, dimension, before=0.3):
    """Share of 24 meshes on which a cut that ends `before` elements short parts a body in two."""
    found = []
    for count in range(5, 11):
        for seed in (None, 0, 1, 2):
            if dimension == 2:
                mesh, size = mesh_of(
                    [0.0] * 2, [1.0] * 2, count, ("right", "left")[count % 2], seed
                )
                cut = Polyline([[-1.0, 0.437], [1.0 - before * size, 0.437]])
            else:
                mesh, size = mesh_of([0.0] * 3, [1.0] * 3, count, "", seed)
                across = [[-1.0, -1.0], [1.0 - before * size, -1.0]]
                across += [[1.0 - before * size, 2.0], [-1.0, 2.0]]
                cut = PolygonPatch([[x, 0.437, z] for x, z in across])
            found.append(len(set(cut_by(rule, mesh, [cut]).bodies.tolist())) > 1)
    return float(np.mean(found))


def rows_of(scenes, quick, dimension):
    """Measure scenes, and print each as a row of a table, then the weighed work."""
    rules = RULES[dimension]
    print(f"| scene | {' | '.join(f'{key} {rule}' for key in 'es' for rule in rules)} |")
    rows = []
    for scene in scenes:
        meshes = meshes_of(scene)[:: (5 if dimension == 2 else 2) if quick else 1]
        rows.append(row := measured(scene, known(scene), meshes, 4 if dimension == 2 else 1))
        errors = [f"{row.error[rule]:.4f}" for rule in rules]
        shifts = [f"{row.shift[rule]:+.2f} ± {row.scatter[rule]:.2f}" for rule in rules]
        print("|", row.name, "|", " | ".join(errors + shifts), "|", flush=True)
    for rule, one in weighed(rows, dimension).items():
        works = []
        for kind, logs in one["works"].items():
            low, high = interval(logs)
            works.append(f"W {kind} {np.exp(np.median(logs)):.3f} ({low:.3f} to {high:.3f})")
        print(rule, " ".join(f"{key} {one[key]:.3f}" for key in one if key != "works"), *works)
    return rows


def main(quick):
    """Print everything."""
    for dimension, scenes, moving in (
        (2, plane_scenes()[:: 6 if quick else 1], (0, 1, 3, 6)),
        (3, space_scenes()[:: 3 if quick else 1], (0, 1)),
    ):
        print("parts", {rule: parts(rule, dimension) for rule in RULES[dimension]}, flush=True)
        rows_of(scenes, quick, dimension)
        for number in moving[: 1 if quick else 4]:
            scene = (plane_scenes() if dimension == 2 else space_scenes())[number]
            mesh, size = meshes_of(scene)[1 if dimension == 3 else 6 + number]
            found = {rule: round(one, 3) for rule, one in jumps(scene, mesh, size).items()}
            print("jump", number, found, flush=True)


if __name__ == "__main__":
    main("--quick" in sys.argv)

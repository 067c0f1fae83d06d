"""Stress-intensity factors as quantities of interest, in the plane and along fronts."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest
import scenes

from reference import fracture
from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.errors import Rules
from verify.compare.hooke import hooke, law_of
from verify.errors import InputError, UnsupportedSceneError
from verify.judge.notices import unavailable_quantities
from verify.judge.quantities import Measured, unit_of
from verify.judge.reference import conforming_reference, exact_reference
from verify.judge.stress_intensity import exact_intensity, solution_intensity
from verify.result import Metric, SolveRecord, Status
from verify.runner.checking import check_scene
from verify.scene import Scene, load_scene
from verify.solution import Solution
from verify.solvers import find_solver
from verify.solvers.conforming_meshes import reference_mesh

ASKED = [
    {"kind": "stress_intensity", "name": f"K_{mode} at the {end}", "end": end, "mode": mode}
    for end in ("start", "end")
    for mode in ("I", "II")
]
RELEASED = {"kind": "energy_release_rate"}


def griffith(**more):
    content = load_scene("statics/griffith_edges").model_dump(by_alias=True)
    content |= {"quantities": ASKED, "acceptance": []} | more
    return Scene.model_validate(content)


@pytest.mark.fenicsx
def test_a_graded_solution_has_the_factors_of_the_exact_crack_at_both_ends():
    asked = [*ASKED, RELEASED | {"name": "G", "end": "end"}]
    case = griffith(
        quantities=asked, reference={"kind": "conforming", "size": 0.8, "levels": 3}
    )  # fmt: skip
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    body, law = body_of(case, exact.singular_points), hooke(case.material)
    stated = exact_reference(case, exact, body, law).quantities
    one = Measured(find_solver("reference").solve(case, 1), body, law, case)
    scale = max(value for value, _ in stated.values())
    for asked in case.quantities:
        found, (expected, width) = one.quantity(asked), stated[asked.name]
        assert width == 0.0
        # P2 graded to the tips, a coarse mesh away from them
        assert abs(found - expected) < 0.01 * scale, asked.name
    assert stated["G"][0] == pytest.approx(
        (stated["K_I at the end"][0] ** 2 + stated["K_II at the end"][0] ** 2)
        * (1 - case.material.poisson**2) / case.material.young
    )  # fmt: skip
    assert [unit_of(case.quantities[i], 2) for i in (0, -1)] == ["Pa √m", "J/m²"]


@pytest.mark.fenicsx
def test_the_xfem_solution_has_factors_too_within_its_order():
    case = griffith()
    body, law = body_of(case), hooke(case.material)
    one = Measured(find_solver("xfem").solve(case, 1), body, law, case)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    expected = exact.stress_intensity[0]
    # P1 without tip enrichment at a tenth of the crack: one tenth
    for asked in case.quantities:
        if asked.mode == "I":
            assert one.quantity(asked) == pytest.approx(expected, rel=0.1)


OPENS_LATER = [{"kind": "polyline", "points": [[-1.0, 0.0], [1.0, 0.0]], "opens_at": 0.5}]
MOTION = {"kind": "dynamic", "duration": 1.0, "outputs": 5}


@pytest.mark.parametrize(
    "changes, asked, reason",
    [
        ({"cuts": [{"kind": "polyline", "points": [[-2, 0], [0, 0]]}]}, {}, "on the boundary"),
        ({"cuts": [{"kind": "polyline", "points": [[-3, 0], [0, 0]]}]}, {}, "outside the body"),
        ({"cuts": [{"kind": "arc", "centre": [0, 0], "radius": 1}]}, None, "closed"),
        (
            {
                "cuts": [
                    {"kind": "polyline", "points": [[-1, 0], [0, 0]]},
                    {"kind": "polyline", "name": "b", "points": [[-1, -1], [-1, 1]]},
                ]
            },
            {},
            "meets another cut",
        ),
        ({"analysis": {"kinematics": "corotational"}}, {}, "linear kinematics"),
        ({"analysis": MOTION | {"damping": [0, 0.1]}}, {}, "stiffness"),
        ({"analysis": MOTION}, {"time": 0.4}, "no output time"),
        ({"analysis": MOTION}, {"time": 0.0}, "opened"),
        ({"analysis": MOTION, "cuts": OPENS_LATER}, {"time": 0.5}, "opened"),
        (
            {
                "analysis": MOTION,
                "loads": [{"kind": "body_force", "force": [0, 1], "history": [[1, 0], [1, 1]]}],
            },
            {},
            "body force jumps",
        ),
    ],
)
def test_a_factor_that_no_solution_can_have_is_refused_beforehand(changes, asked, reason):
    content = load_scene("statics/griffith_inside").model_dump(by_alias=True)
    content["material"]["density"] = 1.0
    content["cuts"] = [{"kind": "polyline", "points": [[-1.0, 0.0], [1.0, 0.0]]}]
    content |= {"acceptance": [], "exact": None, "reference": {}}
    content["supports"] = [{"where": "boundary", "displacement": [0, 0]}]
    content |= changes
    one = {"kind": "stress_intensity", "name": "K", "end": "start"} | (asked or {})
    if asked is None:  # the case file says it
        with pytest.raises(ValueError, match=reason):
            Scene.model_validate(content | {"quantities": [one]})
        return
    scene = Scene.model_validate(content | {"quantities": [one]})
    with pytest.raises(InputError, match=rf"quantities\[0\] \('K'\).*{reason}"):
        check_scene(scene)
    energy = [{"kind": "strain_energy"}]
    check_scene(Scene.model_validate(content | {"quantities": energy}))


def test_what_only_fine_levels_have_is_known_from_those():
    case = griffith(mesh={"pattern": "structured", "cells": [[n, n] for n in (2, 16, 32, 64)]})
    body, law = body_of(case), hooke(case.material)
    levels = {k: find_solver("xfem").solve(case, k, 0, tip="inside") for k in range(4)}
    reference = conforming_reference(case, levels, body, law, Rules(body, 0.5))
    values = reference.record.metrics["K_I at the end"]["values"]
    assert values[0] is None
    assert None not in values[1:]
    assert reference.record.missing is None
    fewer = conforming_reference(
        case, {k: levels[k] for k in (0, 1, 2)}, body, law, Rules(body, 0.5)
    )
    assert "K_I at the end" not in fewer.quantities
    assert "does not fit" in fewer.record.missing["K_I at the end"]


@pytest.mark.parametrize(
    "end, more, nearest",
    [
        ([0.97, 0.57], {}, "the boundary, 0.03 m away"),
        ([0.61, 0.57], {"where": "x > 0.63"}, "an interface between materials, 0.02 m away"),
        ([0.61, 0.57], {"where": "hypot(x - 0.81, y - 0.57) < 0.19"}, "materials, 0.01 m away"),
        ([0.61, 0.57], {"points": [[0.65, 0.13], [0.65, 0.91]]}, "cut 'other', 0.04 m away"),
        ([0.34, 0.51], {}, "the next kink or end of cut 'a', 0.05 m away"),
    ],
)
def test_a_factor_without_room_names_what_is_next_to_the_tip(end, more, nearest):
    cuts = [{"kind": "polyline", "name": "a", "points": [[0.31, 0.47], end]}]
    cuts += [{"kind": "polyline", "name": "other"} | more] if "points" in more else []
    stiff = [more | {"young": 3.0}] if "where" in more else []
    case = griffith(
        geometry={"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]},
        mesh={"cells": [[6, 5]]},
        material={"young": 1.0, "poisson": 0.3, "plane": "strain", "regions": stiff},
        supports=[{"where": "boundary", "displacement": ["0.1*x", "0.2*y"]}],
        cuts=cuts,
        exact=None,
        reference={},
        quantities=[{**ASKED[2], "cut": "a"}],
    )
    solution = find_solver("xfem").solve(case, 0, 0, tip="inside")  # large elements at the end
    with pytest.raises(UnsupportedSceneError, match="does not fit") as refused:
        solution_intensity(case, solution, case.quantities[0])
    assert str(refused.value).endswith(nearest)


def solved(solver, level, value=None, why=""):
    metrics = [] if value is None else [Metric("K_I at the end", value, "Pa √m", None, 0.0, "")]
    return SolveRecord(
        "case", solver, level, Status.SOLVED, metrics=metrics, notes={"K_I at the end": why}
    )


def test_missing_quantities_are_noticed_with_their_levels_and_reason():
    case = griffith(quantities=ASKED[2:3])
    coarse = "too coarse"
    some = [solved("a", 0, why=coarse), solved("a", 1, 1.0), solved("b", 0, 1.0)]
    (one,) = unavailable_quantities(case, some)
    assert (one.about, one.solver) == ("K_I at the end", "a")
    assert one.text == "on level 0: too coarse (level 1 has it)"
    all_alike = [solved(name, level, why=coarse) for name in "ab" for level in (0, 1)]
    (one,) = unavailable_quantities(case, all_alike)
    assert (one.solver, one.text) == (None, "too coarse")
    assert unavailable_quantities(case, [solved("a", 0, 1.0)]) == []


def penny(*asked, **changes):
    """Give the inclined penny under tension and pressure, with factors asked for."""
    content = load_scene("benchmark/c4_disc").model_dump(mode="json", by_alias=True)
    quantities = [
        {"kind": "stress_intensity", "name": f"q{i}", "cut": "crack"} | one
        for i, one in enumerate(asked)
    ]
    content |= {"quantities": quantities, "acceptance": [], "known_findings": []} | changes
    return Scene.model_validate(content)


def exact_of(scene):
    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def front_point(degrees):
    """Where the shear of the inclined penny points ahead, turned on about its normal."""
    normal, centre = np.array([0.36, -0.48, 0.8]), np.array([0.07, -0.04, 0.03])
    ahead = np.array([0.0, 0.0, 1.0]) - 0.8 * normal
    ahead /= np.linalg.norm(ahead)
    turn = np.deg2rad(degrees)
    spoke = np.cos(turn) * ahead + np.sin(turn) * np.cross(normal, ahead)
    return (centre + spoke).tolist()


@pytest.mark.heavy
@pytest.mark.fenicsx
def test_the_three_modes_of_an_inclined_penny_are_kassirs_and_sihs():
    """Graded quadratic elements, 0.06 a at the front: the energy is 1e-3 off, and so is K."""
    scene = penny(
        *({"mode": mode, "point": front_point(60.0)} for mode in ("I", "II", "III")),
        reference={"size": 1.0},
    )
    found = find_solver("reference").solve(scene, 1, repetitions=0)
    exact = exact_of(scene)
    stated = np.array([exact_intensity(scene, exact, asked) for asked in scene.quantities])
    assert stated == pytest.approx([1.2864, 0.3186, 0.3863], abs=1e-4)
    values = [solution_intensity(scene, found, asked) for asked in scene.quantities]
    assert values == pytest.approx(stated, abs=5e-3 * stated[0])


@pytest.mark.fenicsx
def test_the_factors_of_a_pressed_crack_are_those_of_its_closed_form():
    """The faces are freed by a uniform stress: its own field has no factor."""
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    content["exact"]["parameters"] |= {"stress": [0.3, 0.0, 0.0], "pressure": 1.0}
    content |= {
        "loads": [{"kind": "cut_faces", "pressure": 1.0}],
        "quantities": [
            {"kind": "stress_intensity", "name": mode, "end": "end", "mode": mode}
            for mode in ("I", "II")
        ]
        + [RELEASED | {"name": "G", "end": "end"}],
        "acceptance": [],
        "reference": {"kind": "conforming"},
    }
    scene = Scene.model_validate(content)
    found = find_solver("reference").solve(scene, 0, repetitions=0)
    exact = exact_of(scene)
    for asked in scene.quantities:
        stated = exact_intensity(scene, exact, asked)
        assert solution_intensity(scene, found, asked) == pytest.approx(stated, abs=2e-3)


def straight(n, *asked, **changes):
    """A box that is cut in the plane z = 0 up to a straight front, 20 degrees off y."""
    ahead, along = np.array([[0.94, -0.342, 0.0], [0.342, 0.94, 0.0]])
    point = np.array([0.04, -0.03, 0.0])
    corners = [point + a * along - b * ahead for a, b in ((-2, 0), (2, 0), (2, 3), (-2, 3))]
    content = {
        "geometry": scenes.box([0.5] * 3, [-0.5] * 3),
        "mesh": {"cells": [[n, n, n]]},
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "exact": {
            "solution": "straight_front",
            "parameters": {"point": point.tolist(), "normal": [0.0, 0.0, 1.0],
                           "axis": ahead.tolist(), "intensity": [1.0, 0.6, -0.8]},
        },
        "cuts": [{"kind": "polygon", "points": [c.tolist() for c in corners]}],
        "quantities": [
            {"kind": "stress_intensity", "name": f"q{i}", "point": point.tolist()} | one
            for i, one in enumerate(asked)
        ],
    }  # fmt: skip
    return scenes.scene(d=3, **content | changes)


def sampled(scene, n):
    """The exact field at the corners of every tetrahedron of a grid, on the side of its centre."""
    places = np.linspace(-0.5, 0.5, n + 1)
    grid = np.stack(np.meshgrid(places, places, places, indexing="ij"), axis=-1)
    corners = []
    for path in permutations(range(3)):
        at = np.zeros(3, dtype=int)
        row = [at.copy()]
        for axis in path:
            at[axis] += 1
            row.append(at.copy())
        corners.append(np.stack([grid[i : n + i, j : n + j, k : n + k] for i, j, k in row], axis=3))
    cells = np.stack(corners).reshape(-1, 4, 3)
    turned = np.linalg.det(cells[:, 1:] - cells[:, :1]) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    points = cells.reshape(-1, 3)
    u = exact_of(scene).displacement(points, np.repeat(cells.mean(axis=1), 4, axis=0))
    return Solution(points, np.arange(len(points)).reshape(-1, 4), u[None], np.zeros(1))


def test_the_three_modes_at_a_straight_front_are_those_of_its_field_and_found_at_once(monkeypatch):
    """Interpolated linearly on a mesh whose cells the front runs through: order h over the radius.

    At h = 1/16 and a mean radius of 0.3 that is the share h/r = 0.2 of the squares of the strain
    next to the front, whose own share of the integral is h/r again: 4 % of the largest factor.
    """
    modes = ("I", "II", "III")
    scene = straight(16, *({"mode": mode} for mode in modes), RELEASED)
    integrate, calls = fracture.front_intensity, []
    monkeypatch.setattr(
        fracture, "front_intensity", lambda *a, **k: calls.append(1) or integrate(*a, **k)
    )
    one = Measured(sampled(scene, 16), body_of(scene), law_of(scene), scene)
    values = [one.quantity(asked) for asked in scene.quantities]
    assert values[:3] == pytest.approx([1.0, 0.6, -0.8], abs=0.04)
    released = 0.91 * (1.0**2 + 0.6**2) + 1.3 * 0.8**2
    assert values[3] == pytest.approx(released, rel=2 * 0.04)
    assert len(calls) == 1
    exact = exact_of(scene)
    assert [exact_intensity(scene, exact, q) for q in scene.quantities] == pytest.approx(
        [1.0, 0.6, -0.8, released]
    )


def test_means_with_hats_become_the_factor_at_the_middle_of_a_quadratic(
    monkeypatch,
):
    """The mean of a + b s + c s² with a hat of half-width w is that at its middle and c w²/6."""
    scene = straight(4, {"mode": "I"})
    a, b, c, w = 1.3, 0.7, -2.1, 0.4
    means = a + b * w * np.arange(-1, 2) + c * w**2 * (np.arange(-1, 2) ** 2 + 1 / 6)
    found = SimpleNamespace(modes=np.column_stack([means] * 3), release=means)
    monkeypatch.setattr(fracture, "front_intensity", lambda *_, **__: found)
    factor = solution_intensity(scene, sampled(scene, 4), scene.quantities[0])
    assert factor == pytest.approx(a, rel=1e-12)


def test_a_polygon_whose_faces_bear_a_shear_has_the_factors_of_the_field_that_frees_them():
    """A uniform stress beside the field of the front loads the faces, and has no factor."""
    modes = [{"mode": mode} for mode in ("II", "III")]
    free = straight(10, *modes)
    cut = free.cuts[0].model_dump()
    shear = np.array([0.3, -0.2, 0.25])
    # corners in the other order: the positive side is below, where the outer normal is z
    loads = [{"kind": "cut_faces", "traction": shear.tolist()}]
    scene = straight(10, *modes, cuts=[cut | {"points": cut["points"][::-1]}], loads=loads)
    solution = sampled(free, 10)
    stress = np.zeros((3, 3))
    stress[2], stress[:, 2] = shear, shear
    young, poisson = scene.material.young, scene.material.poisson
    strain = ((1 + poisson) * stress - poisson * np.trace(stress) * np.eye(3)) / young
    loaded = replace(solution, displacement=solution.displacement + solution.points @ strain)
    given = [solution_intensity(free, solution, asked) for asked in free.quantities]
    found = [solution_intensity(scene, loaded, asked) for asked in scene.quantities]
    # seen from below the upper face slides the other way, and so does the front run
    assert found == pytest.approx([-given[0], given[1]], abs=1e-9)


def fronts_in_general_position(rng):
    """A penny, or a polygon through the body, anywhere in a box with default sizes."""
    normal = rng.standard_normal(3)
    first, second, normal = np.linalg.svd(normal[None])[2][[1, 2, 0]]
    if rng.random() < 0.5:
        radius = rng.uniform(0.15, 0.8)
        room = 1.9 - radius
        centre = rng.uniform(-0.6, 0.6, 3) * room
        point = centre + radius * (np.cos(1.0) * first + np.sin(1.0) * second)
        return {"kind": "disc", "centre": centre.tolist(), "normal": normal.tolist(),
                "radius": radius}, point  # fmt: skip
    centre, (a, b) = rng.uniform(-0.4, 0.4, 3), rng.uniform(0.3, 0.9, 2)
    corners = [centre + i * a * first + j * b * second
               for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip
    return {"kind": "polygon", "points": [c.tolist() for c in corners]}, centre + a * first


@pytest.mark.fenicsx
def test_a_domain_fits_around_any_front_on_the_first_level_of_a_reference_of_default_size():
    rng = np.random.default_rng(11)
    for _ in range(4):
        cut, point = fronts_in_general_position(rng)
        asked = {"kind": "stress_intensity", "name": "K", "point": point.tolist()}
        scene = scenes.scene([cut], d=3, geometry=scenes.box([2.0] * 3, [-2.0] * 3),
                             quantities=[asked])  # fmt: skip
        mesh, _ = reference_mesh(scene, 0)
        still = Solution(mesh.points, mesh.cells, np.zeros((1, *mesh.points.shape)))
        assert solution_intensity(scene, still, scene.quantities[0]) == 0.0
        assert len(mesh.cells) < 40_000


@pytest.mark.fenicsx
@pytest.mark.parametrize("thick", [0.3, 0.17])
def test_a_front_across_a_slab_has_nodes_within_each_hat_on_the_first_level(thick):
    """Hats are closer than elements that fit the domains: one without a node was refused."""
    slab = scenes.box([0.6, 0.6, thick], [-0.6, -0.6, 0.0])
    corners = [[0.0, -0.1], [-0.8, -0.1], [-0.8, thick + 0.1], [0.0, thick + 0.1]]
    cut = {"kind": "polygon", "points": [[x, 0.1 * x, z] for x, z in corners]}
    asked = {"kind": "stress_intensity", "name": "K", "mode": "III",
             "point": [0.0, 0.0, 0.5 * thick]}  # fmt: skip
    scene = scenes.scene([cut], d=3, geometry=slab, quantities=[asked], reference={"size": 0.4})
    mesh, _ = reference_mesh(scene, 0)
    still = Solution(mesh.points, mesh.cells, np.zeros((1, *mesh.points.shape)))
    assert solution_intensity(scene, still, scene.quantities[0]) == 0.0
    assert len(mesh.cells) < 4_000


@pytest.mark.heavy
@pytest.mark.fenicsx
def test_a_small_penny_has_its_factors_on_the_first_level_of_a_reference_of_default_size():
    """An eighth of the body wide; second-order elements of h/a = 0.22: a few per cent."""
    small = {"a": 0.5, "centre": [0.07, -0.04, 0.03], "normal": [0.36, -0.48, 0.8]}
    content = load_scene("benchmark/c4_disc").model_dump(mode="json", by_alias=True)
    content["cuts"][0]["radius"] = content["exact"]["parameters"]["a"] = small["a"]
    point = 0.5 * (np.array(front_point(90.0)) + small["centre"])
    asked = [{"mode": mode, "point": point.tolist()} for mode in ("I", "III")]
    scene = penny(*asked, cuts=content["cuts"], exact=content["exact"])
    found = find_solver("reference").solve(scene, 0, repetitions=0)
    # 2 p √(a/π) and 4 (1 − ν)/(2 − ν) τ √(a/π): tension 0.64 and pressure 0.5, shear 0.48
    root = np.sqrt(small["a"] / np.pi)
    stated = [2 * 1.14 * root, 4 * 0.7 / 1.7 * 0.48 * root]
    values = [solution_intensity(scene, found, one) for one in scene.quantities]
    assert np.abs(values) == pytest.approx(stated, rel=0.08)

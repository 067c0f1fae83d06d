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
from verify.judge.notices import ringing_factors, unavailable_quantities
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


def line(*points, **more):
    return {"kind": "polyline", "points": points, **more}


OPENS_LATER = [line([-1, 0], [1, 0], opens_at=0.5)]
JUMP = [{"kind": "body_force", "force": [0, 1], "history": [[1, 0], [1, 1]]}]
# before a wave comes, K is as it was: 0.0024, read as 0.0040 and 0.0093 by two solvers
PRESSED_LATER = [{"kind": "cut_faces", "pressure": 1.0, "history": [[0.5, 0.2], [0.5, 1.0]]}]
MOTION = {"kind": "dynamic", "duration": 1.0, "outputs": 5}


def test_factors_ring_where_steps_are_short_beside_a_wave_across_an_element():
    """Pressure waves run at √((λ + 2μ)/ρ), in plane strain with ν = 0.3 at 1.16 √(E/ρ)."""
    content = load_scene("statics/griffith_inside").model_dump(by_alias=True)
    content["material"] |= {"young": 4.0, "poisson": 0.3, "density": 1.0, "plane": "strain"}
    content |= {"acceptance": [], "exact": None, "reference": {}, "analysis": MOTION}
    content |= {"quantities": ASKED[:1], "supports": [{"where": "bottom", "displacement": [0, 0]}]}
    moving = Scene.model_validate(content)
    across = 0.1 / (2.0 * np.sqrt(0.7 / (1.3 * 0.4)))

    def warnings(step, scene=moving):
        steps = SimpleNamespace(size=0.1, iterations={"steps": 1.0 / step})
        return ringing_factors(scene, {1: steps})

    (warned,) = warnings(0.24 * across)
    assert f"is 0.24 of the time in which a pressure wave crosses its elements, {across:.3g} s" in (
        warned.text
    )
    assert not warnings(0.26 * across)
    assert not warnings(0.24 * across, griffith())  # at rest


@pytest.mark.parametrize(
    "changes, asked, reason",
    [
        ({"cuts": [line([-2, 0], [0, 0])]}, {}, "on the boundary"),
        ({"cuts": [line([-3, 0], [0, 0])]}, {}, "outside the body"),
        (
            {"cuts": [line([-1, 0], [0, 0]), line([-1, -1], [-1, 1], name="b")]},
            {},
            "meets another cut",
        ),
        ({"analysis": {"kinematics": "corotational"}}, {}, "linear kinematics"),
        ({"analysis": MOTION | {"damping": [0, 0.1]}}, {}, "stiffness"),
        ({"analysis": MOTION}, {"time": 0.0}, "opened"),
        ({"analysis": MOTION, "cuts": OPENS_LATER}, {"time": 0.5}, "opened"),
        ({"analysis": MOTION, "loads": JUMP}, {}, r"body force\) jumps"),
        ({"analysis": MOTION, "loads": PRESSED_LATER}, {"time": 0.5}, r"cut faces\) jumps"),
    ],
)
def test_a_factor_that_no_solution_can_have_is_refused_beforehand(changes, asked, reason):
    content = load_scene("statics/griffith_inside").model_dump(by_alias=True)
    content["material"]["density"] = 1.0
    content["cuts"] = [line([-1, 0], [1, 0])]
    content |= {"acceptance": [], "exact": None, "reference": {}}
    content["supports"] = [{"where": "boundary", "displacement": [0, 0]}]
    content |= changes
    one = {"kind": "stress_intensity", "name": "K", "end": "start"} | asked
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


def griffith_in_motion(duration, outputs, *shares):
    """A crack at rest, its solution, and a scene in motion: K at shares of its duration."""
    still = griffith(mesh={"cells": [[24, 24]]})
    content = still.model_dump(mode="json", by_alias=True)
    content["material"]["density"] = 1.0
    content |= {
        "analysis": {"kind": "dynamic", "duration": duration, "outputs": outputs}, "exact": None,
        "supports": [{"where": "boundary", "displacement": [0.0, 0.0]}], "reference": {},
        "quantities": [{**ASKED[2], "name": f"{one}", "time": one * duration} for one in shares],
    }  # fmt: skip
    solution = find_solver("xfem").solve(still, 0, 0, tip="inside")
    at_rest = solution_intensity(still, solution, still.quantities[2])
    return Scene.model_validate(content), solution, at_rest


def in_motion(solution, times, u, **more):
    """Without accelerations a factor is as linear in the displacement as at rest."""
    return replace(solution, displacement=u, velocity=0.0 * u, acceleration=0.0 * u, times=times,
                   ledger={}, **more)  # fmt: skip


def test_a_factor_in_motion_is_that_of_the_output_at_its_time():
    duration, outputs = 2e-3, np.array([0.0, 0.5, 0.75, 1.0])  # none at a quarter
    scene, solution, at_rest = griffith_in_motion(duration, 5, 0.25, 0.5, 0.75, 1.0)
    u = np.array([0.0, 0.8, -0.3, 1.7])[:, None, None] * solution.displacement
    early, *others = scene.quantities
    for late in (0.0, 1e-10):  # round-off of times
        own = in_motion(solution, duration * (outputs + late * (outputs == 0.5)), u)
        found = [solution_intensity(scene, own, asked) for asked in others]
        assert found == pytest.approx(at_rest * np.array([0.8, -0.3, 1.7]), rel=1e-12)
        with pytest.raises(UnsupportedSceneError, match=r"no field at 0\.0005 s"):
            solution_intensity(scene, own, early)
    other = in_motion(solution, duration * (outputs + 1e-5 * (outputs == 0.5)), u)
    with pytest.raises(UnsupportedSceneError, match=r"no field at 0\.001 s"):
        solution_intensity(scene, other, others[0])


def test_the_order_of_a_factor_in_motion_is_that_of_its_tip_at_its_time():
    """Levels u (1 + hᵖ): 1.6 times the error hᵖ K. Far from tips the order is ½ at any time."""
    scene, solution, at_rest = griffith_in_motion(1.0, 3, 0.5, 1.0)
    powers, sizes = np.array([2.0, 1.0, 1.5]), (0.4, 0.2, 0.1)
    x, y = solution.points.T
    wave = np.where(np.abs(y) > 1.3, np.sin(5 * x), 0.0)[:, None]
    levels = {}
    for level, h in enumerate(sizes):
        u = solution.displacement * (1.0 + h**powers)[:, None, None] + np.sqrt(h) * wave
        levels[level] = in_motion(solution, np.linspace(0.0, 1.0, 3), u, size=h)
    body = body_of(scene)
    found = conforming_reference(scene, levels, body, law_of(scene), Rules(body, 0.2)).quantities
    for name, power in (("0.5", 1.0), ("1.0", 1.5)):
        value, width = found[name]
        assert value == pytest.approx(at_rest * (1 + sizes[-1] ** power), rel=1e-9)
        assert width == pytest.approx(1.6 * (value - at_rest), rel=1e-6)


def test_an_exact_field_states_the_factors_of_the_end_that_is_asked_for():
    """A field whose tips differ; a cut with kinks has more corners than ends."""
    kinked = [[-0.9, -0.3], [-0.4, 0.1], [0.3, 0.2], [0.8, 0.55]]
    scene = griffith(cuts=[line(*kinked)])
    field = SimpleNamespace(intensity_at=lambda point: tuple(point))
    assert [exact_intensity(scene, field, asked) for asked in scene.quantities] == [
        *kinked[0], *kinked[-1]
    ]  # fmt: skip


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
    ahead = (np.array([0.0, 0.0, 1.0]) - 0.8 * normal) / 0.6
    turn = np.deg2rad(degrees)
    return (centre + np.cos(turn) * ahead + np.sin(turn) * np.cross(normal, ahead)).tolist()


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
    body, law = body_of(scene), law_of(scene)
    one = Measured(found, body, law, scene)
    for asked, (stated, width) in exact_reference(
        scene, exact_of(scene), body, law
    ).quantities.items():
        assert width == 0.0
        (asked,) = (q for q in scene.quantities if q.name == asked)
        assert one.quantity(asked) == pytest.approx(stated, abs=2e-3)
    assert [unit_of(scene.quantities[i], 2) for i in (0, -1)] == ["Pa √m", "J/m²"]


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


def test_the_energy_at_a_straight_front_is_that_of_sihs_densities_within_its_half_width():
    """The density is S(θ)/r, so that a slice which ends at R(θ) has ∫ S R dθ; to 1e-4.

    G. C. Sih, Int. J. Fract. 10 (1974), eq. 5, with 16 πμ S in place of k = K/√π.
    """
    turn, point, poisson, shear = np.deg2rad(131.0), np.array([0.04, -0.03, 0.0]), 0.3, 1 / 2.6
    ahead, normal = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0]])
    k_1, k_2, k_3 = intensity = [1.0, 0.6, -0.8]
    exact = {"point": point.tolist(), "normal": normal.tolist(), "axis": ahead.tolist(),
             "intensity": intensity}  # fmt: skip
    steps = ((-2, 0), (2, 0), (2, 3), (-2, 3))
    corners = [(point - b * ahead + np.array([0, 0, a])).tolist() for a, b in steps]
    scene = straight(
        4, exact={"solution": "straight_front", "parameters": exact},
        cuts=[{"kind": "polygon", "points": corners}], quantities=[{"kind": "strain_energy"}],
    )  # fmt: skip
    # Gauss between the corners of the square, where R has kinks
    square = np.array([[x, y, 0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) - point
    kinks = np.sort([-np.pi, *np.arctan2(square @ normal, square @ ahead), np.pi])
    at, weights = np.polynomial.legendre.leggauss(40)
    half = 0.5 * np.diff(kinks)[:, None]
    theta = (kinks[:-1, None] + half * (1 + at)).ravel()
    c, s = np.cos(theta), np.sin(theta)
    density = k_1**2 * (3 - 4 * poisson - c) * (1 + c) + 4 * k_1 * k_2 * s * (c - 1 + 2 * poisson)
    density += k_2**2 * (4 * (1 - poisson) * (1 - c) + (1 + c) * (3 * c - 1)) + 4 * k_3**2
    way = np.outer(c, ahead[:2]) + np.outer(s, normal[:2])
    reach = ((0.5 * np.sign(way) - point[:2]) / way).min(axis=1)
    energy = (half * weights).ravel() @ (density * reach) / (16 * np.pi * shear)
    found = exact_reference(scene, exact_of(scene), body_of(scene), law_of(scene)).quantities
    value, width = found["strain_energy"]
    assert value == pytest.approx(energy, rel=1e-4)
    assert abs(value - energy) < width < 1e-3 * energy


def test_means_with_hats_become_the_factor_at_the_middle_of_a_quadratic(monkeypatch):
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


DISC = {"kind": "disc", "centre": [0.31, -0.52, 0.44], "normal": [0.3, -0.5, 0.8], "radius": 0.37}
SLAB = {"kind": "polygon", "points": [[0.0, 0.0, -0.1], [-0.8, -0.08, -0.1], [-0.8, -0.08, 0.27],
                                      [0.0, 0.0, 0.27]]}  # fmt: skip


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    ("cut", "point", "changes", "most"),
    [
        (DISC, [0.31, -0.52 + 0.37 * 8 / 89**0.5, 0.44 + 0.37 * 5 / 89**0.5],
         {"geometry": scenes.box([2.0] * 3, [-2.0] * 3)}, 40_000),
        # hats are closer than elements that fit the domains: one without a node was refused
        (SLAB, [0.0, 0.0, 0.085], {"geometry": scenes.box([0.6, 0.6, 0.17], [-0.6, -0.6, 0.0]),
                                   "reference": {"size": 0.4}}, 4_000),
    ],
    ids=["any place, default size", "across a slab"],
)  # fmt: skip
def test_a_domain_fits_around_a_front_on_the_first_level(cut, point, changes, most):
    asked = {"kind": "stress_intensity", "name": "K", "mode": "III", "point": point}
    scene = scenes.scene([cut], d=3, quantities=[asked], **changes)
    mesh, _ = reference_mesh(scene, 0)
    still = Solution(mesh.points, mesh.cells, np.zeros((1, *mesh.points.shape)))
    assert solution_intensity(scene, still, scene.quantities[0]) == 0.0
    assert len(mesh.cells) < most

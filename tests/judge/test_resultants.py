"""Reactions, section forces and mean stresses: against equilibrium, and closed forms."""

import numpy as np
import pytest
import scenes
from scipy.spatial.transform import Rotation

from verify.compare.body import body_of
from verify.compare.errors import Rules
from verify.compare.hooke import law_of
from verify.errors import UnsupportedSceneError
from verify.judge.quantities import Measured, unit_of
from verify.judge.reference import conforming_reference
from verify.judge.resultants import resultants_over_time
from verify.scene import load_scene
from verify.solution import Solution
from verify.solvers import find_solver
from verify.xfem import box_mesh, rectangle_mesh


def reaction(name, where, component, **more):
    return {"kind": "reaction", "name": name, "where": where, "component": component, **more}


def moment(name, where, component, centre):
    return reaction(name, where, component, of="moment", centre=centre)


def section(name, point, normal, component, **more):
    return {"kind": "section", "name": name, "point": point, "normal": normal,
            "component": component, **more}  # fmt: skip


def stress(point, radius, component="xx", **more):
    return {"kind": "stress", "name": f"s_{component}", "point": point, "radius": radius,
            "component": component, **more}  # fmt: skip


def measured(scene, solver="xfem", level=0, solution=None):
    solution = solution or find_solver(solver).solve(scene, level, repetitions=0)
    return Measured(solution, body_of(scene), law_of(scene), scene)


def values(scene, solver="xfem", level=0, solution=None):
    one = measured(scene, solver, level, solution)
    return {asked.name: one.quantity(asked) for asked in scene.quantities}


# a cut in general position, two supports of which one slides and is displaced, all kinds of loads
PLANE = {
    "cuts": [{"kind": "polyline", "points": [[0.31, 0.47], [0.66, 0.81]]}],
    "material": scenes.soft(2, density=1.0),
    "supports": [
        {"where": "left", "displacement": [0.0, 0.0]},
        {"where": "right", "displacement": [0.1], "components": ["x"]},
    ],
    "loads": [
        {"kind": "traction", "where": "top", "traction": ["0.3 * x", "0.2 + x"]},
        {"kind": "body_force", "force": [0.1, "-0.4 * y"]},
        {"kind": "gravity", "acceleration": [0.3, -1.0]},
        {"kind": "cut_faces", "pressure": 0.07},
    ],
}
# ∫0.3x, ∫(0.2 + x); 0.1, −0.2; 0.3, −1; and about (0.2, 0.1): r × f of each
LOAD = np.array([0.15 + 0.1 + 0.3, 0.7 - 0.2 - 1.0])
MOMENT = (0.1 + 1 / 3 - 0.2 * 0.7 - 0.9 * 0.15) + (-0.2 * 0.3 - 0.4 * 0.1) + (-0.3 - 0.4 * 0.3)
MESHES = {"regular": {"cells": [[9, 8]]}, "free": {"pattern": "unstructured", "sizes": [0.11]}}


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    ("solver", "mesh"), [("xfem", "free"), ("conforming", "regular"), ("subdivision", "free")]
)
def test_reactions_balance_loads_and_sections_what_lies_beside_them(solver, mesh):
    about = [0.2, 0.1]
    asked = [reaction(f"{at[0]}{c}", at, c) for at in ("left", "right") for c in "xy"]
    asked += [moment(f"{at[0]}m", at, "z", about) for at in ("left", "right")]
    plane = ([0.1, 0.5], [1.0, 0.2])  # x + y/5 = 1/5: the left of it is a triangle of 1/10
    asked += [section(f"s{c}", *plane, c) for c in "xy"] + [section("sm", *plane, "z", of="moment")]
    scene = scenes.scene(**PLANE, mesh=MESHES[mesh], quantities=asked)
    found = values(scene, solver)
    assert found["lx"] + found["rx"] == pytest.approx(-LOAD[0], abs=1e-12)
    assert found["ry"] == 0.0  # it slides
    assert found["ly"] == pytest.approx(-LOAD[1], abs=1e-12)
    assert found["lm"] + found["rm"] == pytest.approx(-MOMENT, abs=1e-12)
    # gravity and the uniform force on the triangle; ∫y = 1/30: and about (0.1, 0.5), ∫ r × f
    corner = np.array([0.1 * 0.4, -0.4 / 30 - 0.1])
    assert found["sx"] == pytest.approx(-found["lx"] - corner[0], abs=1e-12)
    assert found["sy"] == pytest.approx(-found["ly"] - corner[1], abs=1e-12)
    # centroid (1/15, 1/3), ∫xy over it = 1/600, ∫x = 1/150
    about_point = (1 / 15 - 0.1) * -0.1 - (1 / 3 - 0.5) * 0.04 - 0.4 * (1 / 600 - 0.1 / 30)
    left = found["lm"] + 0.1 * found["ly"] + 0.4 * found["lx"]
    assert found["sm"] == pytest.approx(-left - about_point, abs=1e-12)
    assert [unit_of(asked, 2) for asked in scene.quantities[3:5]] == ["N/m", "N m/m"]


def test_a_clamp_that_is_cut_through_bears_the_load():
    """To (h/δ)² of what decays over δ = √2/4, as elements go on beyond the cut."""
    scene = scenes.scene(
        [{"kind": "polyline", "points": [[-0.1, 0.37], [0.62, 0.61]]}],
        material=PLANE["material"], supports=PLANE["supports"][:1],
        loads=PLANE["loads"][:3], mesh={"cells": [[32, 32]]},
        quantities=[reaction("x", "left", "x"), reaction("y", "left", "y"),
                    moment("m", "left", "z", [0.2, 0.1])],
    )  # fmt: skip
    assert list(values(scene).values()) == pytest.approx([*-LOAD, -MOMENT], abs=5e-4)


def held_apart(start, end, supports, **more):
    """The square, its top held on either side of a cut that comes through it."""
    x = start[0] + (1.0 - start[1]) * (end[0] - start[0]) / (end[1] - start[1])
    sides = [f"y > 1 - 1e-9 and x {sign} {x!r}" for sign in "<>"]
    asked = [reaction(f"{i}{c}", at, c) for i, at in enumerate(sides) for c in "xy"]
    asked += [moment(f"{i}m", at, "z", [0.2, 0.1]) for i, at in enumerate(sides)]
    supports = [{"where": at} | one for at, one in zip(sides, supports, strict=True)]
    return scenes.scene(
        [{"kind": "polyline", "points": [start, end]}], supports=supports,
        material=PLANE["material"], loads=PLANE["loads"][2:3], quantities=asked, **more,
    )  # fmt: skip


def test_supports_on_either_side_of_a_cut_bear_each_its_half():
    """Each is in balance by itself; 0.2 % of the weight is what a clamp that is cut is off by."""
    still, moved = {"displacement": [0.0, 0.0]}, {"displacement": [0.1, 0.05]}
    scene = held_apart([0.37, -0.1], [0.57, 1.1], [still, moved], mesh={"cells": [[16, 16]]})
    found, left = values(scene), 0.47  # its width in the middle
    assert [found["0x"], found["0y"]] == pytest.approx([-0.3 * left, left], abs=2e-3)
    assert [found["1x"], found["1y"]] == pytest.approx([-0.3 + 0.3 * left, 1 - left], abs=2e-3)
    # a cut that ends inside: both together bear the weight, and turn as it turns
    scene = held_apart([0.43, 0.4], [0.57, 1.1], [still, moved], mesh={"cells": [[16, 16]]})
    found = values(scene)
    total = [found[f"0{c}"] + found[f"1{c}"] for c in "xym"]
    assert total == pytest.approx([-0.3, 1.0, 0.3 + 0.4 * 0.3], abs=2e-3)


def test_supports_on_either_side_of_a_loaded_cut_have_no_reaction():
    """What the load on a face does on the elements that one of them holds is not known."""
    scene = held_apart([0.43, -0.1], [0.57, 1.1], [{"displacement": [0.0, 0.0]}] * 2)
    content = scene.model_dump(mode="json", by_alias=True)
    content["loads"].append({"kind": "cut_faces", "pressure": 0.01})
    with pytest.raises(UnsupportedSceneError, match="another support begins at a cut"):
        values(scenes.Scene.model_validate(content))


SOLID = {
    "cuts": [{"kind": "polygon", "points": [[0.35, -0.1, 0.4], [0.78, -0.1, 0.55],
                                            [0.78, 1.1, 0.65], [0.35, 1.1, 0.5]]}],
    "material": scenes.soft(3, density=2.0),
    # in the middle of a face, and a face that slides
    "supports": [
        {"where": "x < 1e-9 and hypot(y - 0.55, z - 0.45) < 0.2", "displacement": [0.0] * 3},
        {"where": "right", "displacement": [0.05], "components": ["x"]},
    ],
    "loads": [
        {"kind": "gravity", "acceleration": [0.1, -0.2, -1.0]},
        {"kind": "traction", "where": "top", "traction": [0.0, "0.3 * x", 0.2]},
    ],
}  # fmt: skip


def test_reactions_of_a_cut_block_balance_its_loads_in_space():
    where = [one["where"] for one in SOLID["supports"]]
    asked = [reaction(f"{i}{c}", at, c) for i, at in enumerate(where) for c in "xyz"]
    origin = [0.0, 0.0, 0.0]
    asked += [moment(f"{i}m{c}", at, c, origin) for i, at in enumerate(where) for c in "xyz"]
    plane = ([0.9, 0.5, 0.93], [0.1, 0.1, 1.0])  # over the cut
    asked += [section(f"s{c}", *plane, c) for c in "yz"]
    scene = scenes.scene(d=3, **SOLID, mesh={"cells": [[9, 8, 9]]}, quantities=asked)
    found = values(scene)
    total = [found[f"0{c}"] + found[f"1{c}"] for c in "xyz"]
    assert total == pytest.approx([-0.2, 0.4 - 0.15, 2.0 - 0.2], abs=1e-12)
    # weight at (½, ½, ½), ∫ r × t on the top: (½·0.2 − 0.15, −½·0.2, ∫0.3x²)
    weight = np.cross([0.5] * 3, [0.2, -0.4, -2.0])
    turned = [found[f"0m{c}"] + found[f"1m{c}"] for c in "xyz"]
    assert turned == pytest.approx(-weight - [0.1 - 0.15, -0.1, 0.1], abs=1e-12)
    # 0.1 x + 0.1 y + z > 1.07: a wedge of V = ∫∫(0.1 x + 0.1 y − 0.07) where positive, which
    # nothing holds along y and z; of the top it has all but the triangle x + y < 0.7
    volume = 0.1 - 0.07 + 0.1 * 0.7**3 / 6
    assert found["sz"] == pytest.approx(0.2 * (1 - 0.7**2 / 2) - 2.0 * volume, abs=1e-12)
    assert found["sy"] == pytest.approx(0.3 * (0.5 - 0.7**3 / 6) - 0.4 * volume, abs=1e-12)


def test_a_reaction_of_a_body_that_turns_far_balances_loads_where_it_has_come_to():
    supports = [{"where": "left", "displacement": [0.0, 0.0]}]
    asked = [reaction("y", "left", "y"), moment("m", "left", "z", [0.0, 0.1]),
             section("s", [0.31, 0.1], [1.0, 0.3], "y")]  # fmt: skip
    scene = scenes.scene(
        geometry=scenes.box([1.0, 0.2]), mesh={"cells": [[15, 3]]}, supports=supports,
        loads=[{"kind": "gravity", "acceleration": [0.0, -0.02]}],
        material=scenes.soft(2, density=1.0), analysis={"kinematics": "corotational"},
        cuts=[{"kind": "polyline", "points": [[0.47, -0.1], [0.55, 0.11]]}], quantities=asked,
    )  # fmt: skip
    solution = find_solver("xfem").solve(scene, 0, repetitions=0)
    found = values(scene, solution=solution)
    places = solution.points + solution.displacement[-1]
    corners = places[solution.cells].mean(axis=1)
    area = np.abs(np.linalg.det(np.diff(solution.points[solution.cells], axis=1))) / 2
    assert np.abs(solution.displacement).max() > 0.2
    assert found["y"] == pytest.approx(0.02 * 0.2, rel=1e-7)
    assert found["m"] == pytest.approx(0.02 * float(area @ corners[:, 0]), rel=1e-7)
    # beyond the plane 0.2 (1 − 0.31) of the body, as it goes through (0.31, 0.1), the middle
    assert found["s"] == pytest.approx(-0.02 * 0.2 * 0.69, rel=1e-6)


@pytest.mark.fenicsx
@pytest.mark.parametrize("solver", ["xfem", "reference"])
def test_a_reaction_in_motion_has_the_inertia_in_it(solver):
    """Supports that move: what both bear is the rate of the momentum, less the loads."""
    swing = {"displacement": ["0.05 * sin(4 * t)", "0.02 * t * t"]}
    asked = [reaction(f"{i}{c}", at, c, time=0.3)
             for i, at in enumerate(("left", "right")) for c in "xy"]  # fmt: skip
    asked += [section(f"s{c}", [0.12, 0.5], [1.0, 0.1], c, time=0.3) for c in "xy"]
    scene = scenes.scene(
        **PLANE | {"supports": [{"where": "left", **swing}, PLANE["supports"][1]],
                   "loads": PLANE["loads"][1:3],
                   "material": scenes.soft(2, density=3.0)},
        mesh=MESHES["regular"], quantities=asked, reference={"size": 0.4},
        analysis={"kind": "dynamic", "duration": 0.4, "time_step": 0.02, "outputs": 5,
                  "damping": [0.2, 0.01]},
    )  # fmt: skip
    one = measured(scene, solver)
    found = {asked.name: one.quantity(asked) for asked in scene.quantities}
    solution, step = one.solution, 3
    rate = one.weak_form.rates(step)
    left = solution.points[:, 0] == 0.0
    known = rate[left] - 0.2 * solution.velocity[step][left]
    assert known == pytest.approx(np.tile([-0.8 * np.sin(1.2), 0.04], (left.sum(), 1)), rel=1e-4)
    total = np.asarray((one.weak_form.mass @ rate).sum(axis=0))
    load = np.array([0.1 + 0.9, -0.2 - 3.0])
    assert [found["0x"] + found["1x"], found["0y"] + found["1y"]] == pytest.approx(
        total - load, abs=1e-8
    )
    assert np.abs(total).min() > 0.05
    over_time = resultants_over_time(one.weak_form, scene.quantities)
    assert over_time["quantity_1x"][step] == found["1x"]
    assert len(over_time["quantity_sx"]) == 5


def test_supports_have_the_acceleration_after_a_kink_and_at_the_end_that_before_it():
    """0.1 t² φ: of φ = 5 t it is 3 t, of φ = 7.5 t − 0.5 it is 4.5 t − 0.1, and 0.5 of φ = 2.5."""
    moves = {"displacement": ["0.1 * t * t", 0.0],
             "history": [[0.0, 0.0], [0.2, 1.0], [0.4, 2.5]]}  # fmt: skip
    scene = scenes.scene(
        supports=[{"where": "left", **moves}], material=scenes.soft(2, density=3.0),
        analysis={"kind": "dynamic", "duration": 0.4, "outputs": 5},
    )  # fmt: skip
    mesh, times = rectangle_mesh((3, 4)), np.linspace(0.0, 0.4, 5)
    u = np.zeros((5, *mesh.points.shape))
    u[:, :, 0] = (0.1 * times**2 * np.interp(times, *np.transpose(moves["history"])))[:, None]
    still = np.zeros_like(u)
    swung = Solution(mesh.points, mesh.cells, u, times, velocity=still, acceleration=still)
    form = measured(scene, solution=swung).weak_form
    left = mesh.points[:, 0] == 0.0
    found = [form.rates(step)[left] for step in range(5)]
    for rates, wanted in zip(found, [0.0, 0.3, 0.8, 1.25, 1.7], strict=True):
        assert rates == pytest.approx(np.tile([wanted, 0.0], (5, 1)), abs=1e-5)


@pytest.mark.parametrize("kind", ["body_force", "traction"])
def test_a_reaction_has_no_value_where_a_load_jumps(kind):
    """By accelerations of before it and the load of after it was off by a tenth."""
    force = {"body_force": {"force": [0.02, 0.05]},
             "traction": {"where": "right", "traction": [0.01, 0.0]}}  # fmt: skip
    load = {"kind": kind, "history": [[0.0, 0.2], [0.5, 0.2], [0.5, 1.0]]} | force[kind]
    scene = scenes.scene(
        material=scenes.soft(2, density=1.0), loads=[load],
        supports=[{"where": "left", "displacement": [0.0, 0.0]}],
        analysis={"kind": "dynamic", "duration": 1.0, "time_step": 0.05, "outputs": 5},
        quantities=[reaction("R", "left", "x", time=0.5)],
    )  # fmt: skip
    one = measured(scene)
    with pytest.raises(UnsupportedSceneError, match=r"a load jumps at 0\.5 s"):
        one.quantity(scene.quantities[0])
    row = resultants_over_time(one.weak_form, scene.quantities)["quantity_R"]
    assert np.isnan(row).tolist() == [False, False, True, False, False]


def test_a_hanging_bar_bears_its_weight_and_the_weight_below():
    """No lateral contraction: the stress is that of the weight below; A = 2e-3, ρg = 9800.

    Reactions, moments and sections to round-off, stresses to (h/L)².
    """
    content = load_scene("controls/hanging_bar").model_dump(mode="json", by_alias=True)
    content |= {"acceptance": [], "quantities": [
        reaction("R", "top", "z"), moment("M", "top", "y", [0.0, 0.0, 0.3]),
        section("N", [0.02, 0.02, 0.11], [0.0, 0.0, 1.0], "z"),
        stress([0.026, 0.021, 0.172], 0.019, "zz"), stress([0.026, 0.021, 0.172], 0.019, "xz"),
    ]}  # fmt: skip
    found = values(scenes.Scene.model_validate(content), "xfem", 1)
    assert found["R"] == pytest.approx(9800 * 6e-4, rel=1e-10)
    # the weight acts at x = 0.025: R about the y axis is −x R_z
    assert found["M"] == pytest.approx(-9800 * 6e-4 * 0.025, rel=1e-9)
    assert found["N"] == pytest.approx(9800 * 2e-3 * 0.11, rel=1e-10)
    assert found["s_zz"] == pytest.approx(9800 * 0.172, rel=0.01)
    assert abs(found["s_xz"]) < 0.01 * 9800 * 0.172


def test_a_mean_stress_is_smooth_in_h_where_one_at_a_point_is_not():
    """Sinusoidal displacement on meshes of any size: errors of the mean fall with h²."""
    worst = {}
    for n in (12, 13, 24, 25):
        scene = scenes.scene(mesh={"cells": [[n, n]]}, quantities=[stress([0.44, 0.57], 0.17)])
        mesh = find_solver("conforming").solve(scene, 0, repetitions=0)
        x, y = mesh.points.T
        u = np.column_stack([np.sin(3 * x + y), 0.0 * x])
        found = values(scene, solution=Solution(mesh.points, mesh.cells, u[None]))["s_xx"]
        # 3 cos(3 x + y) in the disc: its mean is that at the centre times 2 J₁(k r)/(k r)
        kr = np.sqrt(10) * 0.17
        mean = 2 * (kr / 2 - kr**3 / 16 + kr**5 / 384 - kr**7 / 18432) / kr
        lame, shear = 0.3 / 1.3 / 0.4, 1 / 2.6
        exact = (lame + 2 * shear) * 3 * np.cos(3 * 0.44 + 0.57) * mean
        worst[n] = abs(found / exact - 1)
    assert worst[12] < 0.02
    for coarse, fine in ((12, 24), (13, 25)):
        assert worst[fine] < worst[coarse] / 2.5


def test_the_stress_of_a_patch_is_exact_on_both_sides_of_an_inclined_cut():
    content = load_scene("statics/f1_patch").model_dump(mode="json", by_alias=True)
    places = {"above": [0.3, 0.7], "below": [0.66, 0.31]}
    content |= {"acceptance": [], "quantities": [
        stress(at, 0.19, c) | {"name": f"{side} {c}"}
        for side, at in places.items() for c in ("xx", "yy", "xy")
    ]}  # fmt: skip
    scene = scenes.Scene.model_validate(content)
    found = values(scene)
    along = np.array([3.0, 1.0]) / np.sqrt(10)  # free of traction: σ = E/(1 − ν²) e t ⊗ t
    for side, strain in (("above", 0.1), ("below", -0.05)):
        sigma = strain / 0.91 * np.outer(along, along)
        got = [found[f"{side} {c}"] for c in ("xx", "yy", "xy")]
        assert got == pytest.approx([sigma[0, 0], sigma[1, 1], sigma[0, 1]], abs=1e-12)


@pytest.mark.parametrize(
    ("d", "model"), [(3, "hooke"), (2, "neo_hookean"), (3, "stable_neo_hookean")]
)
def test_the_stress_of_a_stretched_and_turned_body_is_that_of_cauchy(d, model):
    """Principal stresses λᵢ ∂W/∂λᵢ / J of the energy of each model, turned with the body."""
    stretches = np.array([1.3, 0.8, 1.1])[:d]
    turns = ("z", [0.7]) if d == 2 else ("zxz", [0.7, 0.4, -0.2])
    turn = Rotation.from_euler(*turns).as_matrix()[:d, :d]
    gradient = turn @ np.diag(stretches) - np.eye(d)
    parts = ("xx", "xy", "yy") if d == 2 else ("xx", "yz", "zz")
    asked = [stress([0.44, 0.57, 0.5][:d], 0.3, part) for part in parts]
    scene = scenes.scene(d=d, material=scenes.soft(d, model=model), quantities=asked,
                         analysis={"kinematics": "corotational"})  # fmt: skip
    mesh = rectangle_mesh((3, 3)) if d == 2 else box_mesh((3, 3, 3))
    moved = (mesh.points @ gradient.T)[None]
    found, law = values(scene, solution=Solution(mesh.points, mesh.cells, moved)), law_of(scene)
    lame, shear, J = law.lame, law.shear, np.prod(stretches)
    volumetric = {  # J dH/dJ
        "neo_hookean": lame * np.log(J) - shear,
        "stable_neo_hookean": J * ((lame + shear) * (J - 1) - shear),
    }
    if model == "hooke":
        slopes = 2 * shear * (stretches - 1) + lame * np.sum(stretches - 1)
    else:
        slopes = shear * stretches + volumetric[model] / stretches
    cauchy = turn @ np.diag(stretches * slopes / J) @ turn.T
    for part in parts:
        wanted = cauchy[tuple("xyz".index(axis) for axis in part)]
        assert found[f"s_{part}"] == pytest.approx(wanted, rel=1e-9)


def test_the_interval_of_a_reaction_holds_the_value_of_far_finer_meshes():
    """A clamp has singular corners: the order is that of the energy, not 2."""
    asked = [reaction("R", "left", "x"), section("N", [0.9, 0.5], [1.0, 0.0], "x"),
             stress([0.2, 0.2], 0.15)]  # fmt: skip
    scene = scenes.scene(
        PLANE["cuts"], supports=[PLANE["supports"][0],
                                 {"where": "right", "displacement": [0.1, 0.05]}],
        mesh={"cells": [[n, n] for n in (8, 16, 32, 128)]}, quantities=asked,
    )  # fmt: skip
    levels = {k: find_solver("conforming").solve(scene, k, repetitions=0) for k in range(4)}
    fine = values(scene, solution=levels.pop(3))
    rules = Rules(body_of(scene), 1 / 32)
    known = conforming_reference(scene, levels, body_of(scene), law_of(scene), rules).quantities
    for name, (value, width) in known.items():
        assert abs(value - fine[name]) <= width < 0.1 * abs(value), name
    assert known["R"][0] == pytest.approx(-known["N"][0], rel=1e-9)


@pytest.mark.fenicsx
def test_a_solution_with_a_pressure_balances_too():
    asked = [reaction(c, "bottom", c) for c in "xy"]
    scene = scenes.scene(
        PLANE["cuts"], material=scenes.soft(2, density=1.0) | {"poisson": 0.4995},
        supports=[{"where": "bottom", "displacement": [0.0, 0.0]}], loads=PLANE["loads"][:3],
        quantities=asked, reference={"size": 0.4},
    )  # fmt: skip
    found = values(scene, "reference")
    assert [found["x"], found["y"]] == pytest.approx(list(-LOAD), abs=1e-9)


@pytest.mark.parametrize(
    "asked, reason",
    [
        (section("s", [0.5, 0.6], [1.0, 0.0], "x"), "elements that a cut meets"),
        (section("s", [1.5, 0.6], [1.0, 0.0], "x"), "misses the body"),
        (section("s", [0.0, 0.2], [0.3, 1.0], "y"), r"meets a support near \(0.0"),
    ],
)
def test_a_section_that_means_nothing_is_refused(asked, reason):
    scene = scenes.scene(**PLANE, mesh=MESHES["regular"], quantities=[asked])
    with pytest.raises(UnsupportedSceneError, match=reason):
        values(scene)


@pytest.mark.parametrize(
    "asked, reason",
    [
        (stress([0.5, 0.9], 0.2), "not in the body"),
        (stress([0.31, 0.6], 0.1), r"is 0.0932\d* m away from cut 'cut'; expected more"),
        (stress([0.7, 0.2], 0.1), "materials differ"),
    ],
)
def test_what_no_solution_can_have_is_refused_beforehand(asked, reason):
    stiff = {"regions": [{"where": "x > 0.75", "young": 3.0}]}
    changes = {"material": scenes.soft(2, density=1.0, **stiff), "quantities": [asked]}
    with pytest.raises(ValueError, match=reason):
        scenes.scene(**PLANE | changes)

"""Claims from the literature: verdicts follow from numbers; numbers against independent values."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from verify.methods import cut_by
from verify.report.study_page import _claim, render_study
from verify.scene import load_scene, load_scenes
from verify.solution import Solution
from verify.solvers import find_solver
from verify.solvers.body_of_scene import cuts_of
from verify.study import claims_measured as measured
from verify.study.claims import (
    ClaimsStudy,
    Judged,
    Judgement,
    Limit,
    claims,
    in_words,
    judgement_of,
)
from verify.study.claims_measured import Number, element_step, exactly, recovered_error
from verify.study.study import write_study
from verify.xfem.element import Material, isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.explicit import element_critical_steps
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

CLAIMS = {claim.measure: claim for claim in claims()}


def inside(limit: Limit) -> Number:
    """Return a number that keeps a limit by a little."""
    bounds = [one for one in (limit.at_least, limit.at_most) if one is not None]
    if len(bounds) == 2 or not bounds:
        return exactly(sum(bounds) / 2.0)
    return exactly(bounds[0] + (1e-9 if limit.at_most is None else -1e-9) * abs(bounds[0]))


def outside(limit: Limit) -> Number:
    """Return a number that breaks a limit by a little."""
    bound = limit.at_most if limit.at_least is None else limit.at_least
    return exactly(bound + (1e-9 if limit.at_least is None else -1e-9) * (abs(bound) or 1.0))


@pytest.mark.parametrize("claim", CLAIMS.values(), ids=CLAIMS)
def test_a_verdict_follows_from_the_numbers_on_both_sides_of_every_limit(claim):
    good, bounded = [inside(limit) for limit in claim.limits], []
    for place, limit in enumerate(claim.limits):
        if limit.at_least is not None or limit.at_most is not None:
            bounded.append(place)
            assert limit.why
    whole = judgement_of(claim.limits, good)
    assert whole is (Judgement.HOLDS if bounded else Judgement.UNTOLD)
    one = Judgement.IN_PART if len(bounded) > 1 else Judgement.NOT
    for place in bounded:
        bad = [outside(n) if k == place else good[k] for k, n in enumerate(claim.limits)]
        assert judgement_of(claim.limits, bad) is one
        for doubtful in (Number(None, note="not installed"), Number(0.0, -1e30, 1e30)):
            bad[place] = doubtful
            assert judgement_of(claim.limits, bad) is Judgement.UNTOLD
    if bounded:
        bad = [outside(n) if k in bounded else good[k] for k, n in enumerate(claim.limits)]
        assert judgement_of(claim.limits, bad) is Judgement.NOT


@pytest.mark.parametrize("dim", [2, 3])
def test_the_step_of_the_smallest_element_is_the_compact_solver_s(dim):
    mesh = rectangle_mesh((4, 5)) if dim == 2 else box_mesh((2, 3, 2))
    moved = np.random.default_rng(3).uniform(-0.03, 0.03, mesh.points.shape)
    mesh = SimplexMesh(mesh.points + moved, mesh.cells)
    stuff = isotropic(1e4, 0.3, "plane strain" if dim == 2 else "solid")
    expected = element_critical_steps(mesh, stuff, 1000.0).min()
    assert element_step(mesh.points, mesh.cells) == pytest.approx(expected, rel=1e-9)


def test_a_recovered_estimate_of_a_quadratic_field_is_its_interpolation_error():
    """(λ + 2μ) h²/12 per area for u = x²/2 along x, but for averages at the boundary."""
    n, lame, shear = 40, 2.0, 3.0
    mesh = rectangle_mesh((n, n))
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    moved = np.stack([0.5 * mesh.points[:, 0] ** 2, 0.0 * mesh.points[:, 1]], axis=1)
    solution = Solution(mesh.points @ turn.T, mesh.cells, (moved @ turn.T)[None])
    expected = np.sqrt((lame + 2.0 * shear) / 12.0) / n
    assert recovered_error(solution, lame, shear) == pytest.approx(expected, rel=0.005)


def test_strains_that_jump_across_a_cut_are_no_error_to_a_recovered_estimate():
    solution = find_solver("xfem").solve(load_scene("statics/f1_patch"), 0)
    assert np.ptp(solution.displacement) > 0.01
    assert recovered_error(solution, 0.6, 0.4) < 1e-12


@pytest.mark.parametrize("method, kept", [
    ("xfem", True), ("virtual_node", True), ("snapping", True),
    ("subdivision", False), ("xfem mass=consistent", False),
])  # fmt: skip
def test_lumped_to_the_sides_no_sliver_shortens_the_step_and_subdivided_each_does(
    method, kept, monkeypatch
):
    """Rows at ε = 0.1, 1e-4 and 1e-6; snapping moves nodes onto the cut in the last two."""
    rows = [s for s in load_scenes("slivers/plane_edges") if s.row.value in (0.1, 1e-4, 1e-6)]
    monkeypatch.setattr(measured, "load_scenes", lambda family: rows)
    steps = measured._shares.__wrapped__("slivers/plane_edges", method)
    if kept:
        assert min(steps[method == "snapping" :]) > 0.99
    else:  # in proportion to ε where that is small
        assert steps[2] / steps[1] == pytest.approx(1e-2, rel=0.05)


def test_removal_takes_the_triangles_that_the_line_crosses():
    """y = 0.3 + (x + 0.1)/3 through squares that rising diagonals halve."""
    shares = []
    for n in (8, 16, 32):
        mesh = rectangle_mesh((n, n))
        x, y = np.moveaxis(mesh.points[mesh.cells], -1, 0)
        level = y - 0.3 - (x + 0.1) / 3.0
        through = (level.min(axis=1) < -1e-12) & (level.max(axis=1) > 1e-12)  # it meets nodes
        shares.append(through.mean())
    lost, order = measured.removal()
    assert lost.value == pytest.approx(shares[-1], rel=1e-12)
    assert order.value == pytest.approx(np.log2(shares[-2] / shares[-1]), rel=1e-9)


def test_the_hanging_bar_with_a_cell_s_mass_at_every_vertex_is_newton_s():
    """Its scene, with more gravity and a pull, against such masses at the nodes themselves."""
    body = cut_mesh(box_mesh((4, 4, 20), upper=(0.2, 0.2, 1.0)), [])
    law = Material(np.array(5e4), np.array(5e4), "stable_neo_hookean")
    held = Supports.none(body).prescribe(body, body.node_points[:, 2] == 1.0)
    load = np.tile([0.0, 0.0, -1000.0 * 0.05**3 * 9.81], (body.node_count, 1))
    moved = static_equilibrium(InternalForce(body, law), held.fixed, load=load).displacement
    expected = -moved[body.node_points[:, 2] == 0.0, 2].mean()
    assert measured.extension(True) == pytest.approx(expected, rel=0.005)
    # ρ g L²/2E, and by less than the largest strain off it
    assert measured.extension(False) == pytest.approx(9810.0 / 2.5e5, rel=0.08)


def test_unknowns_at_equal_error_are_those_of_the_power_law():
    other = np.log([[100.0, 400.0, 1600.0], [0.2, 0.1, 0.05]])  # error 2/√n
    ratio = measured._unknowns_at(other, np.log(0.1), np.log(300.0))
    assert ratio == pytest.approx(0.75, rel=1e-12)


def test_a_number_that_is_not_installed_decides_nothing_and_gives_its_reason():
    found = measured._or_reason(lambda: exactly(measured.extension(False, "no_such_solver")))
    assert found.value is None
    assert "no_such_solver" in in_words(found)


def test_the_page_counts_claims_whose_limits_are_not_of_before_their_numbers(tmp_path):
    moved = [c for c in CLAIMS.values() if c.moved]
    judged = [Judged(c, [exactly(1.0)] * len(c.limits), [""] * len(c.limits), Judgement.IN_PART)
              for c in (*moved, CLAIMS["removal"])]  # fmt: skip
    write_study(tmp_path, "claims", ClaimsStudy(judged=judged, findings=[]), "verify study claims")
    text = render_study(tmp_path, "claims", "markdown").read_text("utf-8")
    assert f"but for those of {len(moved)} claims: dropped afterwards" in text
    assert all(claim.moved in text for claim in moved)


def test_no_text_of_a_claim_has_marks_that_its_page_would_show():
    for claim in CLAIMS.values():
        texts = [claim.sense, claim.who, claim.made, claim.ran, claim.moved]
        texts += [text for limit in claim.limits for text in (limit.number, limit.why)]
        assert not [text for text in texts if set("*`[]") & set(text)]


def test_numbers_beside_a_verdict_are_those_that_decide_it():
    claim = CLAIMS["uncut_step"]
    numbers = [
        exactly(4.44e-16, "0 to 4.44e-16"),
        *(exactly(value) for value in (0.995, 0.894, 1.2)),
    ]

    def seen():
        shown = [in_words(one) for one in numbers]
        return _claim(asdict(Judged(claim, numbers, shown, judgement_of(claim.limits, numbers))))

    first, second, third, _ = (limit.number for limit in claim.limits)
    broken, kept = f"{third} = 0.894 (at least 0.99)", f"{first} = 4.44×10⁻¹⁶ (at most 10⁻⁶)"
    assert seen()["decides"] == f"{broken}; kept: {kept}"
    assert seen()["answer"] == broken
    assert seen()["bounds"][0] == "at most 10⁻⁶"
    assert seen()["authors"] == "Menouillard, Réthoré, Moës, Combescure and Bung 2008"
    numbers[1:] = [Number(0.9, 0.85, 0.98), exactly(0.894), Number(1.1, 0.9, 1.2)]
    both = f"{second} = 0.900 [0.850, 0.980] (at least 0.99); {broken}"
    assert seen()["answer"] == both
    assert seen()["decides"] == f"{both}; 1 more; kept: {kept}"
    numbers[1] = Number(1.0, 0.98, 1.01)  # its interval may break the limit: after those that do
    assert seen()["answer"].startswith(f"{broken}; {second} = 1.00 [0.980, 1.01]")
    numbers[1:] = [exactly(1.0), exactly(0.991), exactly(1.2)]
    assert seen()["decides"] == seen()["answer"] == kept


def test_a_number_without_a_limit_stands_beside_those_that_decide():
    claim = CLAIMS["fewer_unknowns"]
    numbers = [exactly(0.014), exactly(0.009), Number(0.588, 0.588, 2.14), exactly(0.98)]
    shown = [in_words(one) for one in numbers]
    seen = _claim(asdict(Judged(claim, numbers, shown, judgement_of(claim.limits, numbers))))
    first, other = claim.limits[0].number, claim.limits[2].number
    assert seen["decides"] == f"{first} = 0.0140 (at most 1); beside: {other} = 0.588 [0.588, 2.14]"
    untold = CLAIMS["open_question"]
    numbers = [exactly(0.97), exactly(1.8)]
    seen = _claim(asdict(Judged(untold, numbers, shown, judgement_of(untold.limits, numbers))))
    assert seen["decides"] == seen["answer"] == f"{untold.limits[0].number} = 0.970"


def test_errors_over_positions_begin_with_the_mesh_as_it_is_asked(monkeypatch):
    """Position 0 is a level of the case; ends are over all positions."""
    monkeypatch.setattr(measured, "_POSITIONS", 1)
    one, other = (measured._solved("statics/f3_inclined", name, 1)[1]
                  for name in ("xfem", "conforming"))  # fmt: skip
    for found, name in zip(
        measured._over_positions("statics/f3_inclined", 1),
        ("displacement_l2", "energy_norm"), strict=True,
    ):  # fmt: skip
        assert found.value == pytest.approx(one[name].value / other[name].value, rel=1e-6)
        assert found.low == found.value == found.high
    monkeypatch.setattr(measured, "_POSITIONS", 2)
    two = measured._over_positions("statics/f3_inclined", 1)[0]
    assert two.low < two.high
    assert two.value == pytest.approx(0.5 * (two.low + two.high))


def test_the_shape_of_snapped_triangles_is_that_of_their_sides(tmp_path):
    """2r/R = 16 A² / (P a b c); a cut along a line of nodes moves none."""
    mesh = rectangle_mesh((5, 5))

    def shape(snapped):
        corners = snapped.points[snapped.cells]
        a, b, c = (np.linalg.norm(corners[:, k] - corners[:, k - 1], axis=1) for k in range(3))
        half = (a + b + c) / 2.0  # Heron
        area = np.sqrt(half * (half - a) * (half - b) * (half - c))
        return (8.0 * area**2 / (half * a * b * c)).min()

    at, normal = np.array([0.4, 0.47]), np.array([0.3, 1.0])
    scene = measured._given(tmp_path, mesh.points, mesh.cells, at, normal)
    snapped = cut_by("snapping", mesh, cuts_of(scene, 0.2)).phantom.mesh
    found = measured._snapped_shape(scene)
    assert found == pytest.approx(shape(snapped) / shape(mesh), rel=1e-9)
    assert found < 0.99
    level = measured._given(tmp_path, mesh.points, mesh.cells, np.array([0.4, 0.4]), np.eye(2)[1])
    assert measured._snapped_shape(level) == pytest.approx(1.0, rel=1e-12)


def test_the_page_counts_verdicts_and_shows_numbers_limits_and_commands(tmp_path):
    wanted = {"removal": inside, "springs": outside, "open_question": inside}
    judged = []
    for name, make in wanted.items():
        claim = CLAIMS[name]
        numbers = [make(one) if one.why else exactly(1.25) for one in claim.limits]
        shown = [in_words(one) for one in numbers]
        judged.append(Judged(claim, numbers, shown, judgement_of(claim.limits, numbers)))
    low = replace(judged[0].numbers[0], low=0.005)
    assert in_words(low).startswith("0.0100 [0.005")
    study = ClaimsStudy(judged=judged, findings=[])
    write_study(tmp_path, "claims", study, "verify study claims")
    text = render_study(tmp_path, "claims", "markdown").read_text("utf-8")
    first = [line for line in text.splitlines() if line][:3]
    assert first[1] == "Of 3 claims 1 hold, 0 hold in part, 1 does not hold, 1 cannot be told here."
    number = f"{judged[1].claim.limits[0].number} = 0.01"
    sense = judged[1].claim.sense.rstrip(".")
    assert first[2].startswith(f"**Does not hold**: {sense} (Van Gelder 1998): {number}")
    assert "Limits were argued before their first number. Numbers" in text
    for one in judged:
        assert f"`{one.claim.command}`" in text
    assert "1.25" in text
    (row,) = [line for line in text.splitlines() if line.startswith(f"| {judged[1].claim.sense}")]
    assert number in row
    assert f"(at least 0.75) | {judged[1].claim.ran} | Van Gelder 1998 |" in row
    assert len(study.rows()) == sum(len(one.claim.limits) for one in judged)
    assert render_study(tmp_path, "claims").is_file()

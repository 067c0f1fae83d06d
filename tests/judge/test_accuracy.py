from dataclasses import replace

import numpy as np
import pytest
from cut_meshes import STRAIGHT, layered, quadratic, scene, solution
from judged_fields import Cubic, judged

from verify.compare import errors
from verify.judge.accuracy import assess_accuracy
from verify.judge.verdict import with_verdicts
from verify.result import SolveRecord, Status, Verdict, read_result, write_result
from verify.runner.run import SOLVER_FAILED, exit_code


def line(x):
    return 0.5 + (x - 0.5) / 3


def height(points):
    return points[:, 1] - line(points[:, 0])


EXACT = Cubic(height)


def interpolant(n, order=1):
    """The nodal interpolant on a conforming mesh, as a solver would return it."""
    points, cells, layer = layered(n, [line])
    if order == 2:
        layer_of_cell = layer[cells[:, 0]]
        points, cells = quadratic(points, cells)
        layer = np.concatenate([layer, np.tile(layer_of_cell, 3)])
    far = np.where(layer[:, None] == 1, [[0.5, 2.0]], [[0.5, -2.0]])
    u = EXACT.displacement(points, far)
    return solution(points, cells, u, order=order, size=1 / n, unknowns=2 * len(points))


def case(checks, exact=True, **more):
    content = {"exact": {"solution": "cubic"}} if exact else {}
    return scene([STRAIGHT], acceptance=checks, **content, **more)


def assess(checks, solvers, exact=None, **more):
    return judged(case(checks, exact is not None, **more), solvers, exact)


LEVELS = {0: interpolant(8), 1: interpolant(16), 2: interpolant(32)}


def test_interpolants_of_a_smooth_field_converge_with_orders_two_and_one(tmp_path):
    checks = [
        {"check": "rate", "metric": "displacement_l2", "at_least": 1.95},
        {"check": "rate", "metric": "energy_norm", "at_least": 0.95},
        {"check": "error", "metric": "jump_l2", "at_most": 1e-2},
        {"check": "error", "metric": "opening", "at_most": 1e-2},
        {"check": "ratio", "metric": "energy_norm", "within": 0.05},
    ]
    quantities = [
        {"kind": "strain_energy"},
        {"kind": "opening", "name": "opening", "at": 0.4},
        {"kind": "displacement", "name": "corner", "point": [1.0, 1.0], "component": "y"},
    ]
    solvers = {"xfem": LEVELS, "conforming": LEVELS}
    result = assess(checks, solvers, EXACT, quantities=quantities)
    # four checks of each of both solvers, and the ratio of the one to the other
    assert [v.verdict for v in result.verdicts] == [Verdict.PASS] * 9
    finest = result.solves[2]
    assert finest.metric("corner").value == pytest.approx(0.3, abs=1e-14)
    assert finest.metric("corner").reference == pytest.approx(0.3, abs=1e-14)
    ratio = result.verdicts[-1]
    assert ratio.observed == 1.0
    # energies of interpolants exceed the exact one by the square of their error: h²
    energy = [s.metric("strain_energy") for s in result.solves[:3]]
    excess = [m.value / m.reference - 1 for m in energy]
    assert excess[0] / excess[1] == pytest.approx(4, rel=0.1)
    assert excess[1] / excess[2] == pytest.approx(4, rel=0.1)
    write_result(result, tmp_path / "result.json")
    assert read_result(tmp_path / "result.json").verdicts == result.verdicts


@pytest.mark.parametrize(("limit", "finest"), [(1.0001, True), (2.0, False)])
def test_the_finest_rule_is_asked_only_where_a_verdict_hangs_on_it(monkeypatch, limit, finest):
    solvers = {"xfem": {2: LEVELS[2]}}
    found = assess([BOUND], solvers, EXACT).solves[0].metric("energy_norm")
    asked, made = [], errors.rule_of
    monkeypatch.setattr(errors, "rule_of", lambda *a: asked.append(a[2]) or made(*a))
    close = BOUND | {"at_most": limit * found.value}
    again = assess([close], solvers, EXACT).solves[0].metric("energy_norm")
    assert (0 in asked) == finest
    # both are right, as far as they say
    assert abs(again.value - found.value) <= again.uncertainty + found.uncertainty
    assert again.uncertainty < 0.02 * again.value


def test_a_comparison_with_the_sides_swapped_fails():
    checks = [
        {"check": "error", "metric": "jump_l2", "at_most": 0.05},
        {"check": "error", "metric": "displacement_l2", "at_most": 0.05},
    ]
    result = assess(checks, {"xfem": LEVELS}, Cubic(height, swapped=True))
    assert [v.verdict for v in result.verdicts] == [Verdict.FAIL] * 2
    assert result.solves[-1].metric("jump_l2").value > 1.5


def test_ratios_alone_pass_with_a_warning_of_errors_above_100_per_cent():
    ratio = {"check": "ratio", "metric": "jump_l2", "at_most": 2.0}
    solvers = {"xfem": LEVELS, "conforming": LEVELS}
    result = assess([ratio], solvers, Cubic(height, swapped=True))
    assert [v.verdict for v in result.verdicts] == [Verdict.PASS]
    assert {(n.about, n.solver) for n in result.warnings} == {
        ("jump_l2", "xfem"), ("jump_l2", "conforming")
    }  # fmt: skip
    assert "an error of 2" in result.warnings[0].text  # twice the jump: 200 %
    # a check that judges the error itself says it, and where errors are small nothing is said
    bound = {"check": "error", "metric": "jump_l2", "at_most": 0.05}
    assert not assess([ratio, bound], solvers, Cubic(height, swapped=True)).warnings
    assert not assess([ratio], solvers, EXACT).warnings


def test_strains_of_a_body_in_millimetres_are_told_to_be_absurd():
    one = LEVELS[0]
    small, large = (
        assess([], {"xfem": {0: replace(one, displacement=factor * one.displacement)}}, EXACT)
        for factor in (1.0, 1e3)
    )
    assert not small.warnings
    assert [n.about for n in large.warnings] == ["strain"]
    assert "expected lengths in m" in large.warnings[0].text


BOUND = {"check": "error", "metric": "energy_norm", "at_most": 0.06}


def reference(sizes, order=2):
    return {i: interpolant(n, order) for i, n in enumerate(sizes)}


def test_a_fine_reference_judges_as_the_exact_field_does():
    true = assess([BOUND], {"xfem": LEVELS}, EXACT)
    against = assess([BOUND], {"xfem": LEVELS, "reference": reference((12, 24, 48))})
    assert against.verdicts[0].verdict is true.verdicts[0].verdict is Verdict.PASS
    for name in ("displacement_l2", "energy_norm", "jump_l2"):
        measured = against.solves[2].metric(name)
        truth = true.solves[2].metric(name)
        assert abs(measured.value - truth.value) <= measured.uncertainty + truth.uncertainty
        assert measured.uncertainty < 0.1 * measured.value
        # the change of the last level, over the error that the levels before it stated: 1 − 2⁻ᵖ
        assert 0.5 < against.reference.metrics[name]["disagreement"] < 1.25
    assert against.reference.source == "conforming P2, 3 levels, GCI"


def test_a_too_coarse_reference_leaves_the_verdict_undecided_with_the_reason():
    result = assess([BOUND], {"xfem": LEVELS, "reference": reference((3, 6, 12), order=1)})
    (found,) = result.verdicts
    assert found.verdict is Verdict.UNDECIDED
    assert "clearly" in found.reason
    truth = assess([BOUND], {"xfem": LEVELS}, EXACT).verdicts[0].observed
    assert found.low <= truth <= found.high


def test_a_reference_of_two_levels_judges_nothing_and_says_why():
    result = assess([BOUND], {"xfem": LEVELS, "reference": reference((6, 12))})
    assert result.verdicts[0].verdict is Verdict.ERROR
    assert "2 solved levels" in result.verdicts[0].reason
    assert result.solves[0].metric("strain_energy").reference is None


def test_a_level_of_the_reference_that_was_left_out_is_the_first_cause():
    solved = {"xfem": {0: LEVELS[0]}, "reference": reference((6, 12))}
    rows = [
        SolveRecord("a test", name, level, Status.SOLVED, size=one.size)
        for name, own in solved.items()
        for level, one in own.items()
    ]
    reason = "left out: --within asks for 60 s"
    rows.append(SolveRecord("a test", "reference", 2, Status.REFUSED, reason))
    scene = case([BOUND], False)
    result = with_verdicts(scene, assess_accuracy(scene, rows, solved))
    (found,) = result.verdicts
    assert found.verdict is Verdict.UNDECIDED
    assert f": level 2 of the reference: {reason}; it needs at least 3 levels" in found.reason


def test_a_failed_solve_stays_a_record_and_is_an_error_not_a_pass():
    rows = [SolveRecord("a test", "xfem", i, Status.SOLVED, size=0.125 / 2**i) for i in range(3)]
    rows[2] = replace(rows[2], status=Status.TIMEOUT, reason="stopped after 1 s")
    solved = {"xfem": {0: LEVELS[0], 1: LEVELS[1]}}
    result = with_verdicts(case([BOUND]), assess_accuracy(case([BOUND]), rows, solved, EXACT))
    assert result.verdicts[0].verdict is Verdict.ERROR
    assert "stopped after 1 s" in result.verdicts[0].reason
    assert len(result.solves) == 3
    assert result.solves[2].metrics == []
    assert result.solves[1].metrics


def test_a_solution_of_another_body_is_not_measured_but_named():
    """Its fields would be those of the cells nearest to the body."""
    whole, many = LEVELS[0], interpolant(101)  # of so many cells some are looked at
    holes = np.concatenate([whole.cells[:125], whole.cells[:3]])  # three are twice there
    for points, cells, u, said in (
        (whole.points, whole.cells[:64], whole, "cover 0.5 of the body"),
        (whole.points, holes, whole, "of the body is in no cell of the solution"),
        (whole.points + 3.0, whole.cells, whole, "1 of the volume of the solution lies outside"),
        (many.points + 0.3 * np.eye(2)[0], many.cells, many, "of the volume of the solution lies"),
    ):
        other = solution(points, cells, u.displacement[0], size=u.size)
        (found,) = assess([BOUND], {"xfem": {0: other}}, EXACT).verdicts
        assert found.verdict is Verdict.ERROR
        assert said in found.reason


def test_an_answer_that_no_comparison_can_be_made_of_is_its_solvers_failure():
    said = "space of dimension 3; expected cells of dimension 2 in space of dimension 2"
    tetrahedra = np.column_stack([np.tile([0, 1], (2, 1)), [[2, 3], [3, 2]]])
    space = solution(np.vstack([np.zeros(3), np.eye(3)]), tetrahedra, np.zeros((4, 3)))
    result = assess([BOUND], {"guest": {0: space}, "xfem": {0: LEVELS[0]}}, EXACT)
    guest = next(solve for solve in result.solves if solve.solver == "guest")
    assert guest.status is Status.FAILED
    assert guest.reason.startswith("its solution cannot be compared: ")
    assert said in guest.reason
    verdicts = {verdict.solver: verdict for verdict in result.verdicts}
    assert verdicts["xfem"].observed == pytest.approx(0.0986, rel=0.01)


def test_an_energy_that_is_zero_is_known_as_far_as_strains_are():
    """To 1e-10 of the displacement over the size of the body: ½ (λ + 2μ) ε² of the unit square."""
    levels = {i: replace(one, displacement=0 * one.displacement + 0.3)
              for i, one in LEVELS.items()}  # fmt: skip
    found = assess([], {"reference": levels}, quantities=[{"kind": "strain_energy"}])
    known = found.reference.metrics["strain_energy"]
    assert known["reason"] == "zero but for round-off"
    assert known["uncertainty"] == pytest.approx(0.5 * (0.3 + 0.4) / 0.52 * (0.3e-10) ** 2)


@pytest.mark.parametrize("faulty", ["Measured", "error_history"])
def test_a_fault_of_the_comparison_is_an_error_and_not_the_guests_failure(monkeypatch, faulty):
    import verify.judge.accuracy as accuracy

    real = getattr(accuracy, faulty)

    def breaking(given, *rest):
        if getattr(given, "solution", given).unknowns == 13:
            raise FloatingPointError("overflow encountered in multiply")
        return real(given, *rest)

    monkeypatch.setattr(accuracy, faulty, breaking)
    odd = replace(LEVELS[0], unknowns=13)
    result = assess([{**BOUND, "at_most": 0.2}], {"guest": {0: odd}, "xfem": {0: LEVELS[0]}}, EXACT)
    guest = next(solve for solve in result.solves if solve.solver == "guest")
    assert guest.status is Status.SOLVED
    assert not guest.metrics
    verdicts = {verdict.solver: verdict for verdict in result.verdicts}
    assert verdicts["xfem"].observed == pytest.approx(0.0986, rel=0.01)
    assert verdicts["guest"].verdict is Verdict.ERROR
    assert "comparison failed: FloatingPointError: overflow" in verdicts["guest"].reason
    assert exit_code([result]) == SOLVER_FAILED
    # nor is that hidden where no check is made of the guest
    assert exit_code([replace(result, verdicts=[verdicts["xfem"]])]) == SOLVER_FAILED


@pytest.mark.parametrize("size", [1e-9, 1e6])
def test_a_size_that_is_not_that_of_its_cells_costs_no_time_and_changes_no_error(size):
    stated = replace(LEVELS[0], size=size)
    found = assess([BOUND], {"xfem": {0: stated}}, EXACT).solves[0].metric("displacement_l2")
    known = assess([BOUND], {"xfem": {0: LEVELS[0]}}, EXACT).solves[0].metric("displacement_l2")
    # other places of the same integrals: as precise as the comparison states of itself
    assert found.value == pytest.approx(known.value, rel=0.05)

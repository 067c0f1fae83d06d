"""The whole judgement over time: known motions stand in for solvers."""

import numpy as np
import pytest
from cut_meshes import STRAIGHT, layered, scene
from judged_fields import judged

from verify.result import Verdict
from verify.solution import Solution

DURATION = 2.0


def line(x):
    return 0.5 + (x - 0.5) / 3


class Swing:
    """u = sin(ω t) f(x), f smooth on each side of the cut."""

    singular_points = np.zeros((0, 2))
    omega = 0.75 * np.pi

    def __init__(self, time=DURATION):
        self._factor = np.sin(self.omega * time)

    def at(self, time):
        return Swing(time)

    def displacement(self, points, near=None):
        return self._factor * shape(points, points if near is None else near)

    def gradient(self, points, near=None):
        x, y = points.T
        near = points if near is None else near
        o, i = np.zeros_like(x), np.ones_like(x)
        above = np.array([[2 * x, o], [o, i]]).transpose(2, 0, 1)
        below = np.array([[y, x], [o, o]]).transpose(2, 0, 1)
        return self._factor * np.where((near[:, 1] > line(near[:, 0]))[:, None, None], above, below)


def shape(points, near):
    x, y = points.T
    above, below = np.column_stack([x * x, y]), np.column_stack([x * y, 0 * x])
    return np.where((near[:, 1] > line(near[:, 0]))[:, None], above, below)


def swing(n, times, error=0.0, **more):
    """Nodal values of the motion, with a relative error that grows with time."""
    points, cells, layer = layered(n, [line])
    u = shape(points, np.where(layer[:, None] == 1, [[0.5, 2.0]], [[0.5, -2.0]]))
    factor = np.sin(Swing.omega * times) + error * times
    speed = Swing.omega * np.cos(Swing.omega * times)
    return Solution(
        points=points, cells=cells, displacement=factor[:, None, None] * u, times=times,
        velocity=speed[:, None, None] * u, size=1 / n, **more,
    )  # fmt: skip


def assess(checks, solvers, exact=None, **more):
    content = {"exact": {"solution": "swing"}} if exact else {}
    asked = scene(
        [STRAIGHT | {"opens_at": 0.5}],
        acceptance=checks,
        analysis={"kind": "dynamic", "duration": DURATION},
        material={"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 2.0},
        **content, **more,
    )  # fmt: skip
    return judged(asked, solvers, exact)


TIMES = np.linspace(0, DURATION, 9)


def test_an_error_that_grows_with_time_has_its_maximum_at_the_end_and_its_mean_half_way():
    case = {"xfem": {0: swing(8, TIMES, error=0.1)}}
    still = assess([], {"xfem": {0: swing(8, TIMES)}}, Swing())
    solve = assess([], case, Swing()).solves[0]
    # largest at t = 2/3 (sin = 1) and 2 (sin = −1): the scale is the norm of the shape itself,
    # which output times of a quarter second miss by 1 − cos(ω/12) at most; here t = 2 is one
    last, most, mean = (
        solve.metric(f"displacement_l2{way}").value for way in ("", "_max", "_mean")
    )
    floor = still.solves[0].metric("displacement_l2_max").value
    assert last == pytest.approx(0.1 * DURATION, abs=2 * floor)
    assert most == pytest.approx(last, rel=1e-12)
    assert mean == pytest.approx(0.1 * DURATION / 2, abs=2 * floor)
    assert solve.series["time"] == pytest.approx(TIMES)
    assert solve.series["displacement_l2"][-1] == pytest.approx(last, rel=1e-12)
    assert solve.series["displacement_l2"][0] == 0.0
    assert max(solve.series["energy_norm"]) == solve.metric("energy_norm_max").value


def test_a_reference_with_other_output_times_is_interpolated_and_that_is_said():
    levels = {i: swing(n, np.linspace(0, DURATION, 41)) for i, n in enumerate((6, 12, 24))}
    same = assess([], {"xfem": {0: swing(8, TIMES)}, "reference": levels}).solves[0]
    assert "times" not in same.notes
    odd = np.linspace(0, DURATION, 8)
    other = assess([], {"xfem": {0: swing(8, odd)}, "reference": levels}).solves[0]
    assert other.notes["times"].startswith("the reference is interpolated linearly at 6 of 8")
    # linear in time over steps of 0.05: off by (ω/20)²/8 of the largest at most
    off = (Swing.omega / 20) ** 2 / 8
    one, two = (solve.metric("displacement_l2_max").value for solve in (same, other))
    assert abs(one - two) < off + 0.1 * one


def test_conforming_levels_over_time_have_an_uncertainty_in_every_norm():
    levels = {i: swing(n, TIMES) for i, n in enumerate((6, 12, 24))}
    result = assess([], {"xfem": {0: swing(7, TIMES)}, "reference": levels})
    true = assess([], {"xfem": {0: swing(7, TIMES)}}, Swing())
    for name in ("displacement_l2_max", "displacement_l2_mean", "energy_norm_max", "jump_l2_mean"):
        found, truth = (r.solves[0].metric(name) for r in (result, true))
        assert abs(found.value - truth.value) <= found.uncertainty + truth.uncertainty, name
        assert found.uncertainty > 0
    assert result.solves[1].metric("displacement_l2_max") is None  # no judge of itself


def flying(times, energy):
    """A body that flies with a kinetic energy (t,) per mass, and states that it keeps the first."""
    points, cells, _ = layered(4, [line])
    speed = np.sqrt(2 * energy)[:, None, None] * np.array([0.6, 0.8])
    shape = (len(times), *points.shape)
    return Solution(
        points=points, cells=cells, displacement=np.zeros(shape), times=times, mass="consistent",
        velocity=np.broadcast_to(speed, shape).copy(), size=0.25,
        ledger={"kinetic": 2.0 * energy[0] + 0 * times, "strain": 0 * times},
    )  # fmt: skip


def test_a_known_drift_and_a_known_jump_are_found_and_judged_whatever_the_ledger_says():
    times = np.linspace(0, DURATION, 201)
    drifting = flying(times, 1.0 - 0.03 * times)
    jumping = flying(times, 1.0 + 0.2 * (times > 0.5))
    checks = [
        {"check": "error", "metric": "energy_drift", "at_most": 0.01},
        {"check": "error", "metric": "energy_jump", "at_most": 0.01},
        {"check": "error", "metric": "energy_jump", "at_most": 0.01, "solver": "b"},
        {"check": "error", "metric": "energy_slope", "at_most": 0.01, "solver": "b"},
        {"check": "error", "metric": "ledger_mismatch", "at_most": 0.05, "solver": "xfem"},
    ]
    result = assess(checks, {"xfem": {0: drifting}, "b": {0: jumping}}, Swing())
    verdicts = [(v.metric, v.solver, v.verdict) for v in result.verdicts]
    assert verdicts == [
        ("energy_drift", "xfem", Verdict.FAIL),
        ("energy_drift", "b", Verdict.FAIL),
        ("energy_jump", "xfem", Verdict.PASS),
        ("energy_jump", "b", Verdict.FAIL),
        ("energy_jump", "b", Verdict.FAIL),
        ("energy_slope", "b", Verdict.PASS),
        ("ledger_mismatch", "xfem", Verdict.FAIL),
    ]
    one, other = result.solves
    assert one.metric("energy_drift").value == pytest.approx(0.06, rel=1e-12)
    assert one.metric("energy_slope").value == pytest.approx(0.06, rel=1e-9)
    # over the largest energy, after the jump: 1.2
    assert other.metric("energy_jump").value == pytest.approx(0.2 / 1.2, rel=1e-9)
    assert one.metric("ledger_mismatch").value == pytest.approx(0.06, rel=1e-9)
    warned = {notice.solver: notice.text for notice in result.warnings}
    assert warned.keys() == {"xfem", "b"}
    assert "kinetic by 0.06 of" in warned["xfem"]


def test_a_solution_that_ends_early_is_an_error_that_says_so():
    checks = [{"check": "error", "metric": "displacement_l2_max", "at_most": 1.0}]
    result = assess(checks, {"xfem": {0: swing(4, 0.5 * TIMES)}}, Swing())
    assert result.verdicts[0].verdict is Verdict.ERROR
    assert "ends at 1 s; the scene at 2 s" in result.verdicts[0].reason


def test_a_quantity_at_a_time_is_taken_then():
    quantities = [
        {"kind": "displacement", "name": f"at {t}", "point": [1.0, 1.0], "component": "x",
         "time": t}
        for t in (0.4, 0.6)
    ]  # fmt: skip
    own = np.array([0.0, 0.4, 1.0, 2.0])  # where the solution has none it is not on a line
    solve = assess([], {"xfem": {0: swing(4, own)}}, Swing(), quantities=quantities).solves[0]
    at_last = np.sin(Swing.omega * 0.4)  # f_x = 1 in that corner
    assert solve.metric("at 0.4").value == pytest.approx(at_last, rel=1e-12)
    assert solve.metric("at 0.4").reference == pytest.approx(at_last, rel=1e-12)
    assert solve.metric("at 0.6") is None
    assert "no field at 0.6 s" in solve.notes["at 0.6"]

"""The one timeline of all that moves: what is one time, where steps end, when something opens."""

import numpy as np
import pytest
from scenes import scene

from verify.solvers.interface import find_solver, parameters_in, solver_in
from verify.solvers.runs import march, notes_of_steps, timeline_of

OFF = 1e-10  # s, of a motion of one second: less than what steps added up are off by


class Noted:
    """Body that notes what the march asks of it; things open at `events`, the step then shrinks."""

    def __init__(self, largest, events=(), shrinks=1.0):
        self.time, self.largest, self.shrinks = 0.0, largest, shrinks
        self.events, self.done = sorted(events), []

    def open(self, time):
        due = [event for event in self.events if event <= time + 1e-9]
        self.events = self.events[len(due) :]
        self.done += [("open", time)] if due else []
        self.largest *= self.shrinks if due else 1.0
        return bool(due)

    def begin(self):
        self.done.append(("begin", self.time))

    def put_out(self):
        self.done.append(("output", self.time))

    def step(self, size):
        self.time += size
        self.done.append(("step", size))

    def times(self, what):
        return [time for name, time in self.done if name == what]


def timeline(outputs=2, kinks=False, opens=(), history=None):
    cuts = [
        {"kind": "polyline", "name": f"c{k}", "points": [[0.1, y], [0.4, y]], "opens_at": time}
        for k, (y, time) in enumerate(zip(np.linspace(0.2, 0.8, len(opens)), opens, strict=True))
    ]
    load = {"kind": "gravity", "acceleration": [0, -1]}
    drawn = {"kind": "traction", "where": "top", "traction": [0, 1.0], "history": history}
    moving = scene(
        cuts=cuts,
        loads=[load, drawn] if history else [load],
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        analysis={
            "kind": "dynamic", "kinematics": "linear", "duration": 1.0, "time_step": 0.01,
            "outputs": outputs,
        },
    )  # fmt: skip
    return timeline_of(moving, kinks)


def test_times_that_are_one_up_to_added_steps_are_one_stop():
    found = timeline(
        outputs=3, opens=[0.5 + OFF, 0.3], history=[[0.3 - OFF, 0.0], [0.3 - OFF, 1.0]]
    )
    np.testing.assert_array_equal(found.stops, [0.0, 0.3, 0.5, 1.0])
    np.testing.assert_array_equal(found.opens, [0.5, 0.3])
    assert found.breaks.tolist() == [0.3]
    # farther apart they stay two
    assert timeline(outputs=3, opens=[0.5 + 1e-6]).stops.tolist() == [0.0, 0.5, 0.5 + 1e-6, 1.0]


@pytest.mark.parametrize("kinks, stops", [(False, [0.0, 0.6, 1.0]), (True, [0.0, 0.2, 0.6, 1.0])])
def test_kinks_end_a_step_where_they_are_asked_for_and_jumps_always(kinks, stops):
    table = [[0.2, 0.0], [0.6, 1.0], [0.6, 0.5]]
    assert timeline(kinks=kinks, history=table).stops.tolist() == stops


def test_steps_between_stops_are_equal_and_no_larger_than_asked_for():
    body = Noted(0.3)
    sizes = march(timeline(opens=[0.35], outputs=2), body)
    assert sizes == {0.175: 2, 0.65 / 3: 3}
    np.testing.assert_allclose(body.times("step"), [0.175] * 2 + [0.65 / 3] * 3, rtol=1e-13)
    assert body.times("output") == pytest.approx([0.0, 1.0])
    notes = notes_of_steps(scene(), sizes, "", "", 1.0)
    assert notes["time step"] == "0.175 s … 0.216667 s"


def test_halvings_halve_also_the_steps_that_stops_cut_short():
    stops = timeline(opens=[0.1], outputs=2)
    for halvings in (0, 1, 2):
        body = Noted(0.3)
        sizes = march(stops, body, halvings)
        np.testing.assert_allclose(body.times("step")[0], 0.1 / 2**halvings)
        assert sizes.total() == (1 + 3) * 2**halvings


def test_what_opens_on_the_way_opens_at_the_first_step_that_begins_then_or_later():
    body = Noted(0.1, events=[0.0, 0.2, 0.41, 1.0])
    march(timeline(outputs=2), body)
    assert body.times("open") == pytest.approx([0.0, 0.2, 0.5, 1.0])
    assert body.times("begin") == pytest.approx([0.0, 0.2, 0.5, 1.0])
    assert [name for name, _ in body.done][-3:] == ["open", "begin", "output"]


def test_steps_are_counted_anew_where_an_opening_makes_them_smaller():
    body = Noted(0.25, events=[0.4], shrinks=0.4)
    march(timeline(outputs=2), body, halvings=1)
    np.testing.assert_allclose(body.times("step"), [0.125] * 4 + [0.05] * 10, rtol=1e-13)
    assert body.time == pytest.approx(1.0, abs=1e-12)
    # one that leaves the step as it is leaves the halved steps too
    body = Noted(0.3, events=[0.1])
    assert march(timeline(outputs=2), body, halvings=2).total() == 16


def test_a_trial_is_one_step():
    body = Noted(0.1, events=[0.0])
    assert march(timeline(outputs=2), body, trial=True).total() == 1
    assert len(body.times("output")) == 1


def test_steps_of_one_size_are_one_size_whatever_the_state_has_added_up():
    """An integrator is made for a size: of a thousand stops apart alike there is one."""
    body = Noted(1e-4)
    assert list(march(timeline(outputs=1001), body).values()) == [10_000]
    assert body.time != 1.0


def test_what_jumps_at_a_break_is_taken_up_once_and_after_an_output_then():
    """An output at a jump is the state that came there; at an opening it is what goes on."""
    body = Noted(0.25, events=[0.0, 0.75])
    march(timeline(outputs=3, history=[[0.5, 1.0], [0.5, 0.5], [0.75, 0.5], [0.75, 0.0]]), body)
    said = [name for name, _ in body.done]
    assert said == [
        "open", "begin", "output", "step", "step", "output", "begin", "step", "open", "begin",
        "step", "output",
    ]  # fmt: skip


@pytest.mark.fenicsx
@pytest.mark.parametrize("solver", ["xfem", "xfem scheme=central_differences", "conforming"])
@pytest.mark.parametrize("table", [[[0, 0], [0.5, 1], [1, 0.2]], [[0, 0], [0.5, 0.2], [0.5, 1]]])
def test_a_kink_at_the_end_of_a_step_is_there_whatever_round_off_the_time_has(solver, table):
    """Time × T and density × T² change nothing; 0.35 of 0.7 s lies beside its output time.

    The output at a kink is what comes there: a pulled end still has its velocity of before.
    """
    found = {}
    for time in (0.3, 0.7, 1.1):
        moving = scene(
            [{"kind": "polyline", "points": [[0.5, 0.4], [0.6, 1.1]]}],
            material={"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 11.0 * time**2},
            supports=[
                {"where": "left", "displacement": [0.0, 0.0]},
                {"where": "right", "displacement": [0.1, 0.05],
                 "history": [[share * time, factor] for share, factor in table]},
            ],
            analysis={"kind": "dynamic", "duration": time, "time_step": time / 30, "outputs": 7},
        )  # fmt: skip
        mass = {"mass": "sidewise"} if "central" in solver else {}
        one = find_solver(solver_in(solver)).solve(moving, 0, 0, **parameters_in(solver), **mass)
        end = one.points[:, 0] == 1.0
        assert one.velocity[3, end] * time == pytest.approx(
            np.tile(np.multiply([0.1, 0.05], table[1][1] / 0.5), (end.sum(), 1)), abs=1e-3
        )
        found[time] = one.displacement, one.velocity * time, one.acceleration * time**2
    for time in (0.7, 1.1):
        for one, other in zip(found[time], found[0.3], strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-8 * np.abs(other).max())


@pytest.mark.fenicsx
def test_a_velocity_that_supports_take_up_at_once_is_that_of_an_independent_program():
    """On one mesh two programs agree to round-off, kinks inside steps too; the balances close."""
    moving = scene(
        material={"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 0.3},
        supports=[
            {"where": "left", "displacement": [0.0, 0.0]},
            {"where": "right", "displacement": [0.1, "0.05 * y"],
             "history": [[0.0, 0.2], [0.31, 1.0], [0.6, 0.2], [0.6, 0.2], [0.8, 0.9]]},
        ],
        analysis={"kind": "dynamic", "duration": 1.0, "time_step": 0.02, "outputs": 6},
        cuts=[{"kind": "polyline", "points": [[-0.1, 0.5], [1.1, 0.5]], "opens_at": 0.6}],
    )  # fmt: skip
    one, other = (find_solver(name).solve(moving, 0, 0) for name in ("xfem", "conforming"))
    for name in ("kinetic", "strain", "work_of_supports", "total"):
        np.testing.assert_allclose(one.ledger[name], other.ledger[name], rtol=0.0, atol=1e-10)
    assert np.ptp(one.ledger["total"]) < 1e-12 < 1e-3 < np.ptp(one.ledger["work_of_supports"])
    assert np.abs(one.ledger["algorithmic"]).max() < 1e-12


def test_a_kink_leaves_no_velocities_that_ring_in_generalised_alpha():
    """By Newmark's rule held nodes would swing by twice the change of their velocity."""
    moving = scene(
        material={"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 1.0},
        supports=[{"where": "right", "displacement": [0.1, 0.0],
                   "history": [[0.0, 0.0], [0.5, 1.0]]}],
        analysis={"kind": "dynamic", "duration": 1.0, "time_step": 0.02, "outputs": 11},
    )  # fmt: skip
    one = find_solver("xfem").solve(moving, 0, 0, scheme="generalised_alpha")
    end = one.points[:, 0] == 1.0
    assert np.abs(one.velocity[6:, end]).max() < 1e-3 * 0.2

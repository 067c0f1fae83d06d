"""Real-time step control at cuts (thesis, 4.4.4), with a clock that the tests wind."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, material

from verify.xfem.cuts import Plane
from verify.xfem.dynamics import (
    DynamicBody,
    MeasuredPace,
    RealTimeEuler,
    StepPerUnknown,
    inherit_state,
)
from verify.xfem.dynamics.step_control import StepLimits
from verify.xfem.errors import XfemError
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports
from verify.xfem.virtual import cut_mesh

COST = 2e-5  # seconds of the wound clock per unknown and step


class WoundClock:
    def __init__(self):
        self.seconds = 100.0

    def __call__(self):
        return self.seconds


def bodies():
    mesh = rectangle_mesh((6, 6))
    cuts = [Plane([0.5, 0.45], [0.1, 1.0]), Plane([0.45, 0.5], [1.0, 0.2])]
    for count in range(3):
        v = cut_mesh(mesh, cuts[:count])
        mass = side_wise_mass(v, DENSITY)
        yield DynamicBody(
            InternalForce(v, material(2)),
            mass,
            weight=mass.weight([0.0, -GRAVITY]),
            supports=Supports.none(v).prescribe(v, mesh.points[:, 1] == 1.0),
        )


def simulate(control, clock, first_step, steps=20):
    """A body cut twice: (step size, lag gained per simulated second) at each stage, and its end."""
    old, state, step, stages = None, None, first_step, []
    for body in bodies():
        if old is None:
            state = body.rest()
        else:
            state = inherit_state(old.force.virtual, body.force.virtual, state)
            step = control(step, state.time, body.fixed.size)
        scheme = RealTimeEuler(body, step)
        wall, time = clock(), state.time
        for _ in range(steps):
            scheme.step(state)
            clock.seconds += COST * body.fixed.size
        stages.append((step, (clock() - wall) / (state.time - time) - 1.0))
        old = body
    return stages, state


def test_a_step_per_unknown_keeps_up_with_the_clock_through_every_cut():
    clock = WoundClock()
    control = StepPerUnknown(COST)
    stages, _ = simulate(
        lambda _step, _time, unknowns: control.after_cut(unknowns), clock, control.after_cut(98)
    )
    for _, lag in stages:
        assert lag == pytest.approx(0.0, abs=1e-9)
    assert [step for step, _ in stages] == sorted({step for step, _ in stages})


def test_a_measured_pace_makes_up_for_what_the_step_before_the_cut_was_wrong():
    """Started 4 × too fast: after one cut behind by what that cut added, and no more."""
    clock = WoundClock()
    unknowns = [body.fixed.size for body in bodies()]
    pace = MeasuredPace(clock=clock)
    stages, state = simulate(
        lambda step, time, _unknowns: pace.after_cut(step, time), clock, COST * unknowns[0] / 4.0
    )
    assert stages[0][1] == pytest.approx(3.0, rel=1e-9)
    for stage in (1, 2):
        step, lag = stages[stage]
        assert step == pytest.approx(COST * unknowns[stage - 1], rel=1e-9)
        assert lag == pytest.approx(unknowns[stage] / unknowns[stage - 1] - 1.0, rel=1e-9)
    assert pace.lag(state.time) == pytest.approx(clock() - 100.0 - state.time)


def test_a_simulation_with_a_step_per_unknown_repeats_to_the_last_digit():
    ends = []
    for _ in range(2):
        control = StepPerUnknown(COST)
        _, state = simulate(
            lambda _s, _t, unknowns, c=control: c.after_cut(unknowns), WoundClock(), 2e-3
        )
        ends.append(state.displacement)
    assert np.array_equal(*ends)


def test_the_time_per_unknown_is_the_median_of_steps():
    clock, costs = WoundClock(), iter([3.0, 1.0, 50.0, 2.0, 2.0])

    def step():
        clock.seconds += next(costs)

    control = StepPerUnknown.measured(step, 100, 5, clock)
    assert control.seconds == pytest.approx(0.02)
    assert control.after_cut(150) == pytest.approx(3.0)


def test_steps_beyond_the_limits_are_limited_and_counted():
    """An explicit scheme is held below its critical step, and then is not in real time."""
    limits = StepLimits(1e-3, 5e-3)
    control = StepPerUnknown(1e-5, limits)
    steps = [control.after_cut(unknowns) for unknowns in (10, 200, 1000)]
    assert steps == [1e-3, 2e-3, 5e-3]
    assert limits.limited == 2
    clock = WoundClock()
    pace = MeasuredPace(0.0, clock, StepLimits(largest=5e-3))
    clock.seconds += 1.0
    assert pace.after_cut(2e-3, 0.1) == 5e-3
    assert pace.limits.limited == 1


def test_two_cuts_at_one_instant_leave_the_step_and_the_account_of_time():
    clock = WoundClock()
    pace = MeasuredPace(0.0, clock)
    clock.seconds += 0.5
    assert pace.after_cut(1e-3, 0.25) == pytest.approx(2e-3)
    assert pace.after_cut(2e-3, 0.25) == 2e-3
    assert pace.after_cut(2e-3, 0.26) == 2e-3  # a clock too coarse to have moved
    clock.seconds += 0.5
    assert pace.after_cut(2e-3, 0.75) == pytest.approx(2e-3)


def test_times_that_make_no_sense_are_refused():
    with pytest.raises(XfemError, match="per unknown"):
        StepPerUnknown(0.0)
    with pytest.raises(XfemError, match="step limits"):
        StepLimits(2.0, 1.0)
    with pytest.raises(XfemError, match="at least one"):
        StepPerUnknown.measured(lambda: None, 0)
    pace = MeasuredPace(1.0, WoundClock())
    with pytest.raises(XfemError, match="go back"):
        pace.after_cut(1e-3, 0.5)

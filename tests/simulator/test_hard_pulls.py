"""A coarse membrane pulled to more than twice its length: bounded energy, and where that ends."""

from dataclasses import replace

import numpy as np
import pytest
from thesis_stages import stage

from verify.simulator import Session, quality_of
from verify.xfem.body import RayleighDamping

FRAME = 1.0 / 60.0


@pytest.fixture(scope="module")
def incised(coarse_face):
    """The incision of the case in the coarse mesh, not yet pulled."""
    return replace(coarse_face, strokes=stage("face_incision").strokes)


def pulled(incised, times, within, damping=4.0, time_step=FRAME, after=0.4) -> Session:
    """Pull as in the case but that many times as far, within some seconds; go on for others."""
    hooks = [
        replace(hook, vector=times * hook.vector, duration=within)
        for hook in stage("face_incision").hooks
    ]
    duration = hooks[0].begin + within + after
    given = {"damping": RayleighDamping(damping, damping / 400.0), "time_step": time_step}
    session = Session(replace(incised, hooks=hooks, duration=duration, **given))
    session.run()
    return session


def gain(session) -> float:
    """Largest excess of what the body has over what was done to it, relative to that."""
    work = max(record.work for record in session.records)
    return max(record.mechanical - record.work for record in session.records) / work


def assert_no_gain(session) -> None:
    assert quality_of(session).largest_stretch > 2.0
    work = max(record.work for record in session.records)
    lost = np.array([record.dissipated for record in session.records])
    assert np.diff(lost).min() > -1e-12 * work
    assert gain(session) < 1e-12
    for record in session.records:
        assert abs(record.balance) < 1e-12 * work


def test_hard_pulls_gain_no_energy_in_any_step(incised) -> None:
    assert_no_gain(pulled(incised, 3.0, 0.4, 0.0, after=0.1))


def test_a_pull_within_two_frames_gains_for_a_moment_and_ends_where_short_steps_end(
    incised,
) -> None:
    """The limit of one linearised step per frame: 35 mm within two of them.

    What is gained is lost again: implicit Euler is dissipative once nothing moves the supports.
    """
    coarse = pulled(incised, 5.0, 2 * FRAME)
    assert gain(coarse) > 0.1
    last = coarse.records[-1]
    assert last.mechanical < last.work
    fine = pulled(incised, 5.0, 2 * FRAME, time_step=FRAME / 4)
    assert_no_gain(fine)
    assert last.mechanical == pytest.approx(fine.records[-1].mechanical, rel=0.02)
    assert last.kinetic < 1e-3 * last.strain

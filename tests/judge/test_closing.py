"""Closing cuts: overlaps stand in the record, warn unless they are meant, and are drawn."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from pressed_halves import normal, pressed

from reference.exact import exact_of
from verify.judge.openings import with_openings
from verify.result import CaseResult, Metric, ReferenceRecord, SolveRecord, Status
from verify.scene import load_scene
from verify.solution import ContactPressure

ALONG = np.array([normal(2)[1], -normal(2)[0]])
STILL = np.eye(2), np.zeros(2)


def scene(**more):
    """A square, cut through."""
    ends = [(0.5 + s * ALONG).tolist() for s in (-0.8, 0.8)]
    cut = {"kind": "polyline", "name": "through", "points": ends}
    return scenes.scene([cut], material=scenes.soft(density=1.0), **more)


def moved(shift, n=5, seed=0, **more):
    return replace(pressed(2, n, [STILL, (np.eye(2), np.asarray(shift))], seed=seed), **more)


def examined(asked, solutions, exact=None):
    """Result of a case whose solutions are given."""
    solves = [
        SolveRecord(asked.name, name, level, Status.SOLVED, metrics=[Metric("one", 1.0, "1")])
        for name, own in solutions.items()
        for level in own
    ]
    blank = CaseResult(asked.name, "", "", "", {}, ReferenceRecord(), solves, [], [])
    return with_openings(blank, asked, solutions, exact)


def levels(shift):
    return {k: moved(shift, 4 + k, k, size=0.25 / 2**k) for k in range(3)}


def test_an_overlap_stands_in_every_record_warns_for_each_solver_and_is_drawn():
    shift = -0.0185 * normal(2) + 0.1 * ALONG
    solutions = {"xfem": {0: moved(shift, 5, 7)}, "reference": levels(shift)}
    result = examined(scene(), solutions)
    for solve in result.solves:
        assert solve.metric("overlap_depth").value == pytest.approx(0.0185, rel=1e-6)
        assert "deformed (" in solve.notes["overlap_depth"]
    assert sorted(warned.solver for warned in result.warnings) == ["reference", "xfem"]
    assert all("0.0185 m at (" in warned.text for warned in result.warnings)
    (profile,) = result.openings
    assert [curve.solver for curve in profile.curves] == ["reference", "xfem"]
    assert profile.arc == sorted(profile.arc)
    # from mouth to mouth: a line at the angle of the cut through a square of side 1
    assert profile.arc[-1] - profile.arc[0] == pytest.approx(1 / ALONG[0], rel=1e-3)
    for curve in profile.curves:
        assert curve.normal == pytest.approx([-0.0185] * len(profile.arc), abs=1e-12)
        assert curve.tangential == pytest.approx([0.1] * len(profile.arc), abs=1e-12)
    assert max(profile.curves[0].normal_band) < 1e-12  # all levels are exact here
    assert profile.curves[1].normal_band == []


@pytest.mark.parametrize("fall", [4.0, 8.0])
def test_the_band_of_a_jump_believes_no_order_above_two(fall):
    """Two, for a normal distribution around the place, times what order two leaves of it: d/3."""
    off = [4e-3 / fall**k for k in range(4)]
    own = {k: moved((0.02 + off[k]) * normal(2), 4 + k, k, size=0.25 / 2**k) for k in range(4)}
    (profile,) = examined(scene(), {"xfem": {0: own[0]}, "reference": own}).openings
    band = np.array(profile.curves[0].normal_band)
    assert band == pytest.approx(2.0 * (off[2] - off[3]) / 3.0, rel=1e-6)


def test_profiles_of_faces_that_touch_hold_their_pressures_with_the_band():
    """At the first order of the stress of linear elements: two times the last difference."""
    touching = scene(contact={"expected": "closed"})
    along = np.linspace(-0.6, 0.6, 301)

    def own(pressure, level):
        places, weights = 0.5 + along[:, None] * ALONG, np.full(301, 0.004)
        stated = ContactPressure(places, weights, np.broadcast_to(pressure, (1, 301)))
        return moved(0.0 * ALONG, 4 + level, level, size=0.25 / 2**level, contact=stated)

    reference = {k: own(1.0 + 8e-3 / 2**k, k) for k in range(4)}  # the last three count
    solutions = {"xfem": {0: own(1.0 + along, 0)}, "reference": reference}
    (profile,) = examined(touching, solutions).openings
    known, xfem = profile.curves
    assert known.pressure == pytest.approx([1.001] * len(profile.arc), rel=1e-12)
    assert known.pressure_band == pytest.approx([2.0 * 1e-3] * len(profile.arc), rel=1e-6)
    places = (np.array(profile.points) - 0.5) @ ALONG
    assert xfem.pressure == pytest.approx(1.0 + places, rel=1e-9)


def test_the_pressure_of_an_exact_field_is_minus_its_stress_across_and_zero_where_it_is_open():
    """−Re Z of the partly closed crack, Z = σ′(ξ − c/2) √((ξ + c)/(ξ − c)), on −c ≤ … < 0."""
    crack = load_scene("contact/partly_closed_crack")
    (profile,) = examined(crack, {}, exact_of(crack)).openings
    (known,) = profile.curves
    c, xi = 2 / 3, np.array(profile.arc) - 1 - 1 / 3
    wanted = np.where(
        xi < -c, 1e-3 * (0.5 * c - xi) * np.sqrt(((xi + c) / (xi - c)).clip(0.0)), 0.0
    )
    assert np.count_nonzero(wanted) == pytest.approx(0.39 * len(xi), abs=1)
    assert known.pressure == pytest.approx(wanted, abs=1e-3 * wanted.max())


@pytest.mark.parametrize("shift", [0.02 * normal(2), 0.1 * ALONG, 0.0 * ALONG])
def test_what_opens_slides_or_stays_does_not_warn(shift):
    result = examined(scene(), {"xfem": {0: moved(shift)}, "reference": levels(shift)})
    assert not result.warnings
    assert [s.metric("overlap_depth").value for s in result.solves] == [0.0] * 4


# the faces of a sheared cut stay closed; a solver that is off by a hundredth of the slip overlaps
# by that, which is its error; one that is off by half of the slip gives another answer
@pytest.mark.parametrize(("off", "warns"), [(0.001, False), (0.05, True)])
def test_an_error_of_the_opening_is_no_overlap_unless_it_is_another_answer(off, warns):
    slip = 0.1 * ALONG
    solutions = {"xfem": {0: moved(slip - off * normal(2))}, "reference": levels(slip)}
    result = examined(scene(), solutions)
    assert result.solves[0].metric("overlap_depth").value == pytest.approx(off, rel=1e-6)
    assert bool(result.warnings) == warns


def in_motion(*shifts):
    """Openings of a motion over a second, evenly in time."""
    frames = [moved(s * normal(2)) for s in shifts]
    motion = replace(
        frames[0], displacement=np.concatenate([f.displacement for f in frames]),
        times=np.linspace(0.0, 1.0, len(shifts)),
    )  # fmt: skip
    asked = scene(analysis={"kind": "dynamic", "duration": 1.0})
    return examined(asked, {"xfem": {0: motion}})


def shown_openings(result):
    return {profile.why: profile.curves[0].normal[5] for profile in result.openings}


def test_the_deepest_overlap_of_a_motion_is_found_at_its_time():
    result = in_motion(0.0, 0.04, -0.03, 0.01)
    assert result.solves[0].metric("overlap_depth").value == pytest.approx(0.03, rel=1e-6)
    assert "at 0.6667 s" in result.warnings[0].text
    assert shown_openings(result) == pytest.approx(
        {"last output time": 0.01, "largest opening": 0.04, "deepest overlap of xfem": -0.03}
    )


def test_a_motion_without_overlap_is_shown_where_it_is_most_open_and_last():
    result = in_motion(0.01, 0.02, 0.04, 0.03)
    assert not result.warnings
    assert shown_openings(result) == pytest.approx(
        {"last output time": 0.03, "largest opening": 0.04}
    )

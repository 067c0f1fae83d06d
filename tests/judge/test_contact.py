"""Errors of a stated pressure of contact, on pressures whose errors are known in closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from judged_fields import judged

from reference.exact import exact_of
from verify.compare.body import body_of
from verify.compare.cut_rule import CutRule
from verify.compare.errors import Rules
from verify.compare.hooke import law_of
from verify.compare.motion import SolutionMotion
from verify.judge.contact import (
    contact_metrics,
    exact_contact,
    exact_pressure,
    known_contact,
    stated_pressure,
)
from verify.solution import ContactPressure, Solution

LINE = {"kind": "polyline", "points": [[-0.1, 0.3], [1.1, 0.7]]}
STRAIN = [[-1e-3, 0.0], [0.0, -1e-3]]
UNIFORM = 1e-3 / (1.3 * 0.4)  # E ε / ((1+ν)(1−2ν))


def pressed_scene(cut=LINE):
    """A square of hydrostatic strain with an inclined cut."""
    return scenes.scene(
        [cut], contact={"expected": "closed"},
        supports=[{"where": "boundary", "displacement": "exact"}],
        exact={"solution": "linear", "parameters": {"matrix": STRAIN, "shift": [0.0, 0.0]}},
    )  # fmt: skip


def measured(pressure, known=None, slide=0.0, cut=LINE, turn=None, back=False):
    """Metrics of a stated pressure on an inclined cut through a square of hydrostatic strain.

    Against the exact one, or another that is `known`. Its facets are the straight line. A second
    output time has the faces `back`, as they are without a slide.
    """
    scene = pressed_scene(cut)
    x = np.linspace(0.0, 1.0, 401)[:-1] + 1 / 800
    places = np.column_stack([x, 1 / 3 + x / 3])
    contact = ContactPressure(
        places, np.full(len(x), np.hypot(1, 1 / 3) / len(x)), pressure(x)[None]
    )
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 1 / 3], [1, 2 / 3]], dtype=float)
    corners = np.concatenate([corners, corners[4:]])
    cells = np.array([[0, 1, 4], [1, 5, 4], [6, 7, 3], [7, 2, 3]])
    moved = corners @ np.array(STRAIN)
    moved[[2, 3, 6, 7]] += slide * np.array([3.0, 1.0]) / np.sqrt(10.0)
    if turn is not None:
        moved = (corners + moved) @ turn.T - corners
    solution = Solution(corners, cells, moved[None], size=0.1, contact=contact,
                        cut_facets=corners[None, [4, 5]])  # fmt: skip
    if back:
        both = np.stack([moved, corners @ np.array(STRAIN)])
        twice = replace(contact, pressure=np.repeat(contact.pressure, 2, axis=0))
        solution = replace(solution, displacement=both, times=np.arange(2.0), contact=twice)
    body, law = body_of(scene), law_of(scene)
    rule = Rules(body, 0.1).on_cuts()
    known = known or exact_contact(exact_of(scene), law, rule, 0.0, "exact")
    motion = SolutionMotion(solution, body)
    found, notes = contact_metrics(solution, motion, rule, known, 0.1, turn is not None)
    return {one.name: one for one in found}, notes, solution


def test_a_true_pressure_has_no_error_and_its_extent_and_force_are_those_of_the_cut():
    found, notes, _ = measured(lambda x: np.full_like(x, UNIFORM))
    assert not notes
    assert found["contact_pressure"].value < 1e-12
    length = np.hypot(1.0, 1 / 3)
    for name, wanted in (("contact_extent", length), ("contact_force", UNIFORM * length)):
        assert found[name].value == pytest.approx(wanted, rel=1e-12)
        assert found[name].reference == pytest.approx(wanted, rel=1e-9)
    assert found["contact_slip"].value < 1e-12


def test_a_pressure_that_is_off_alike_at_two_outputs_is_off_as_much_as_at_one():
    once, twice = (
        measured(lambda x: np.full_like(x, 1.07 * UNIFORM), back=back)[0]["contact_pressure"]
        for back in (False, True)
    )
    assert once.value == pytest.approx(0.07, rel=1e-9)
    assert twice.value == pytest.approx(0.07, rel=1e-9)


def test_a_wave_shorter_than_elements_is_oscillation_and_an_offset_is_none():
    """A sine of half an element is all oscillation: its mean over two elements is small."""
    wave, _, _ = measured(lambda x: UNIFORM * (1 + 0.2 * np.sin(2 * np.pi * x / 0.05)))
    offset, _, _ = measured(lambda x: np.full_like(x, 1.1 * UNIFORM))
    assert wave["contact_pressure"].value == pytest.approx(0.2 / np.sqrt(2), rel=1e-3)
    assert wave["contact_oscillation"].value == pytest.approx(0.2 / np.sqrt(2), rel=0.05)
    assert offset["contact_pressure"].value == pytest.approx(0.1, rel=1e-9)
    assert offset["contact_oscillation"].value < 1e-12


def test_of_a_wave_longer_than_elements_what_its_mean_over_four_leaves_is_oscillation():
    """The mean over two elements on either side, up to the ends of the cut, in closed form."""
    k = 2 * np.pi
    found, _, _ = measured(lambda x: UNIFORM * (1.0 + 0.1 * np.sin(k * x)))
    x, reach = np.linspace(0.0, 1.0, 2001), 0.2 / np.hypot(1.0, 1 / 3)
    low, high = np.maximum(x - reach, 0.0), np.minimum(x + reach, 1.0)
    left = np.sin(k * x) - (np.cos(k * low) - np.cos(k * high)) / k / (high - low)
    assert found["contact_pressure"].value == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-6)
    oscillation = 0.1 * np.sqrt(np.mean(left**2))
    assert found["contact_oscillation"].value == pytest.approx(oscillation, rel=0.02)
    assert oscillation < 0.3 * found["contact_pressure"].value


def test_a_solve_is_judged_by_the_pressure_of_the_exact_field():
    _, _, solution = measured(lambda x: np.full_like(x, 1.01 * UNIFORM))
    scene = pressed_scene()
    record = judged(scene, {"xfem": {0: solution}}, exact_of(scene)).solves[0]
    assert record.metric("contact_pressure").value == pytest.approx(0.01, rel=1e-9)
    force = record.metric("contact_force")
    assert force.value == pytest.approx(1.01 * force.reference, rel=1e-9)
    assert force.reference == pytest.approx(UNIFORM * np.hypot(1.0, 1 / 3), rel=1e-9)


def test_faces_that_slide_by_more_than_half_an_element_are_not_judged():
    slid, notes, _ = measured(lambda x: np.full_like(x, UNIFORM), slide=0.07)
    assert list(slid) == ["contact_slip"]
    assert slid["contact_slip"].value == pytest.approx(0.7, rel=1e-9)
    assert notes["contact_pressure"].startswith("faces slide by 0.7 elements")
    little, notes, _ = measured(lambda x: np.full_like(x, UNIFORM), slide=0.03)
    assert little["contact_pressure"].value < 1e-12


def test_faces_that_slide_and_come_back_have_slid():
    slid, notes, _ = measured(lambda x: np.full_like(x, UNIFORM), slide=0.07, back=True)
    assert slid["contact_slip"].value == pytest.approx(0.7, rel=1e-9)
    assert "contact_pressure" in notes


def test_faces_slide_as_far_in_a_body_that_has_turned():
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    slid, notes, _ = measured(lambda x: np.full_like(x, UNIFORM), slide=0.07, turn=quarter)
    assert slid["contact_slip"].value == pytest.approx(0.7, rel=1e-9)
    assert "contact_pressure" in notes


def test_faces_of_a_curved_cut_slide_as_far_though_its_facets_are_off_it():
    """An arc that is up to 0.014 off its chord, an eighth of an element."""
    arc = {"kind": "arc", "centre": [0.5 + 10**0.5, 0.5 - 3 * 10**0.5], "radius": 10.02,
           "start": 104.816, "sweep": 7.238}  # fmt: skip
    slid, _, _ = measured(lambda x: np.full_like(x, UNIFORM), slide=0.07, cut=arc)
    assert slid["contact_slip"].value == pytest.approx(0.7, rel=1e-2)


def test_a_pressure_of_a_part_of_the_cut_or_beside_it_is_not_judged():
    """Left out are the places where it is wrong, so that those stated have no error."""
    _, _, solution = measured(lambda x: np.full_like(x, UNIFORM))
    body = body_of(scenes.scene([LINE]))
    rule = Rules(body, 0.1).on_cuts()
    known = SimpleNamespace(pressures=[lambda at, _: np.full(len(at), UNIFORM)], resultants=[])
    some, beside = (replace(solution.contact, **change) for change in (
        {"points": solution.contact.points[:100], "weights": solution.contact.weights[:100],
         "pressure": solution.contact.pressure[:, :100]},
        {"points": solution.contact.points + np.array([0.0, 0.3])},
    ))  # fmt: skip
    for stated, said in ((some, "of 0.2635 m of cuts; expected 1.054"), (beside, "m off the cuts")):
        lying = replace(solution, contact=stated)
        found, notes = contact_metrics(lying, SolutionMotion(lying, body), rule, known, 0.1)
        assert found == []
        assert set(notes) > {"contact_pressure", "contact_force"}
        assert said in notes["contact_pressure"]


def test_half_of_the_faces_together_is_half_the_extent_and_a_stated_pressure_is_a_truth():
    half, _, solution = measured(lambda x: np.where(x < 0.5, UNIFORM, 0.0))
    length = np.hypot(1.0, 1 / 3)
    assert half["contact_extent"].value == pytest.approx(0.5 * length, rel=1e-9)
    assert half["contact_pressure"].value == pytest.approx(np.sqrt(0.5), rel=1e-9)
    stated = stated_pressure(solution)
    at = np.array([[0.2, 0.4], [0.9, 1 / 3 + 0.3]])
    np.testing.assert_allclose(stated(at, 0.0), [UNIFORM, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    "fall, formal, wanted", [(4.0, 2.0, 1.6 / 3.0), (2.0, 2.0, 2.5), (1.2, 2.0, 2.5 / (2**0.5 - 1))]
)
def test_a_reference_is_known_by_its_levels_to_the_safety_factor_over_the_fall(
    fall, formal, wanted
):
    """Of the last difference: 1.6/(2² − 1) at the formal order, 2.5/(2ᵖ − 1) below, p ≥ ½."""
    off = [1e-2 / fall**k for k in range(3)]
    levels = [measured(lambda x, o=o: np.full_like(x, UNIFORM * (1 + o)))[2] for o in off]
    places = levels[0].contact.points
    rule = CutRule.beside(places, levels[0].contact.weights, np.zeros_like(places), 0.0)
    truth = known_contact(levels, rule, "levels", [0.4, 0.2, 0.1], formal, np.inf)
    found, _, _ = measured(lambda x: np.full_like(x, UNIFORM), truth)
    last = off[1] - off[2]
    assert found["contact_pressure"].uncertainty == pytest.approx(
        wanted * last / (1 + off[2]), rel=1e-6
    )
    force = found["contact_force"]
    assert force.uncertainty == pytest.approx(
        wanted * last * UNIFORM * np.hypot(1.0, 1 / 3), rel=1e-6
    )
    assert force.reference == pytest.approx(UNIFORM * (1 + off[2]) * np.hypot(1, 1 / 3), rel=1e-9)


def test_without_a_stated_pressure_nothing_is_measured_and_why():
    _, _, solution = measured(lambda x: x)
    found, notes = contact_metrics(replace(solution, contact=None), None, None, None, 0.1)
    assert not found
    assert notes == {"contact_pressure": "the solver states no pressure of contact"}


def test_an_exact_pressure_is_of_the_positive_face():
    """A body that is pressed above its cut, y = −0.3, and not below it: 3 times 0.01."""
    points = np.array([[0.1, -0.3], [0.7, -0.3]])
    rule = SimpleNamespace(
        points=points, positive=points + np.array([0.0, 1e-3]), normals=np.array([[0.0, 1.0]] * 2)
    )

    class Pressed:
        def gradient(self, places, beside):
            found = np.zeros((len(places), 2, 2))
            found[:, 1, 1] = np.where(beside[:, 1] > places[:, 1], -0.01, 0.0)
            return found

    law = SimpleNamespace(at=lambda places: law, piola=lambda g: 3.0 * g)
    pressure = exact_pressure(Pressed(), law, rule)
    assert pressure(points + np.array([0.05, 0.0]), None) == pytest.approx([0.03, 0.03])

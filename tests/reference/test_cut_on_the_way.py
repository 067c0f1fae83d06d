"""Bodies that a blade cuts while they move: what opens when, and what it does to energy."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from test_membranes import HANGING as HANGING_SKIN
from test_membranes import bowl_scene, moved
from test_motion import moving, solved, spread
from test_solid_motion import moving as solid

pytestmark = needs_fenicsx

INCLINED = {"kind": "tool_path", "name": "stroke", "points": [[-0.1, 0.33], [1.1, 0.71]]}
BENT = {
    "kind": "tool_path",
    "name": "bent",
    "points": [[0.21, 0.83], [0.42, 0.57], [0.66, 0.52], [0.79, 0.31]],
}
ACROSS = {"kind": "tool_path", "name": "across", "points": [[0.71, -0.2], [0.38, 1.2]]}
PULLED = {
    "supports": [
        {"where": "bottom", "displacement": [0, 0]},
        {"where": "top", "displacement": [0.02, 0.03]},
    ],
    "initial": {"kind": "equilibrium"},
}
UNSTRUCTURED = {"pattern": "unstructured", "sizes": [0.2]}


def plate(paths, **changes):
    return moving(paths, **{"duration": 0.3, "outputs": 4, "mesh": UNSTRUCTURED} | changes)


def hidden(ledger):
    """The largest change of the account that closes it, over the energy in play."""
    energy = max(np.ptp(ledger[name]) for name in ("kinetic", "strain", "gravity"))
    return np.ptp(ledger["total"]) / energy


@pytest.mark.parametrize(
    ("paths", "degree"),
    [
        ([{**BENT, "speed": 3.5, "starts_at": -0.05}], 2),
        ([{**INCLINED, "times": [0.0, 0.1]}, {**ACROSS, "times": [0.1, 0.22]}], 1),
    ],
)
def test_a_conservative_scheme_keeps_the_energy_of_a_plate_at_every_opening(paths, degree):
    found = solved(plate(paths, **PULLED), degree=degree, opening="late")
    ledger = found.ledger
    assert int(found.notes["openings"]) >= 5
    assert np.ptp(ledger["kinetic"]) > 0.01 * ledger["strain"][0]
    # fifty solves to 1e-11 of the forces; nothing is damped and nothing works
    energy = ledger["kinetic"] + ledger["strain"]
    assert spread(energy) < 1e-10
    assert np.abs(ledger["algorithmic"]).max() < 1e-10 * energy[0]
    assert np.abs(ledger["unbalanced"]).max() < 1e-10 * energy[0]


def test_what_generalised_alpha_takes_at_the_openings_is_its_own_and_the_account_closes():
    path = {**INCLINED, "times": [0.02, 0.25]}
    taken = {}
    for radius in (1.0, 0.5):
        scene = plate([path], **PULLED)
        ledger = solved(scene, scheme="generalised_alpha", spectral_radius=radius).ledger
        assert hidden(ledger) < 1e-10
        taken[radius] = ledger["algorithmic"][-1] / ledger["strain"][0]
    assert abs(taken[1.0]) < 1e-10
    assert taken[0.5] > 0.01


DAMPED = {"damping": (2.0, 0.01)}


def altered(scene, **changes):
    return scene.model_copy(update={"analysis": scene.analysis.model_copy(update=changes)})


@pytest.mark.parametrize(
    ("opening", "kinematics"),
    [("blade", "corotational"), ("at once", "linear"), ("load", "linear")],
)
def test_what_damping_does_at_a_jump_is_not_thrown_by_generalised_alpha(kinematics, opening):
    """The trapezoidal rule weighs no old acceleration by itself: it cannot throw.

    Both are of second order, but for the delay of a step that rho = 0 has behind each opening:
    0.01 s of 0.25 s, 4 %. With the acceleration of balance behind each jump it is 30 % behind
    a blade and 180 % and 320 % behind a cut that opens at once.
    """
    paths = [{**INCLINED, "times": [0.02, 0.25]}] if opening == "blade" else []
    given = dict(PULLED)
    if opening == "at once":
        whole = {"kind": "polyline", "name": "whole", "points": INCLINED["points"]}
        paths = [{**whole, "opens_at": 0.083}]
    if opening == "load":
        history = [[0.0, 0.0], [0.083, 0.0], [0.083, 1.0], [1.0, 1.0]]
        traction = {"kind": "traction", "where": "top", "traction": [100.0, 50.0]}
        given["supports"] = PULLED["supports"][:1]
        given["loads"] = [{**traction, "history": history}]
    scene = altered(plate(paths, **given, kinematics=kinematics), **DAMPED)
    degree = 2 if kinematics == "linear" else 1
    right = solved(scene, scheme="newmark", degree=degree)
    size = np.abs(right.displacement - right.displacement[0]).max()
    found = solved(scene, scheme="generalised_alpha", spectral_radius=0.0, degree=degree)
    assert np.abs(found.displacement - right.displacement).max() < 0.04 * size
    assert hidden(found.ledger) < 1e-10
    given_in = found.ledger["strain"].max() + found.ledger["kinetic"].max()
    assert np.abs(found.ledger["algorithmic"]).max() < 0.1 * given_in


def test_generalised_alpha_stays_of_second_order_where_a_damped_plate_opens_at_once():
    """Modes that the steps resolve (mesh of 0.25): errors fall by four, here at least by three."""
    whole = {"kind": "polyline", "name": "whole", "points": INCLINED["points"], "opens_at": 0.08}
    given = {**PULLED, "mesh": {"pattern": "unstructured", "sizes": [0.25]}}
    scene = plate([whole], **given, duration=0.16, outputs=3)
    fields = []
    for step in (4e-3, 2e-3, 5e-4):
        one = altered(scene, damping=(2.0, 0.002), time_step=step)
        found = solved(one, scheme="generalised_alpha", spectral_radius=0.0)
        fields.append(found.displacement)
    errors = [np.linalg.norm(one - fields[-1]) for one in fields[:-1]]
    assert errors[0] > 3.0 * errors[1]


def test_a_facet_opens_at_the_first_step_that_begins_after_the_blade_has_passed_it():
    """Four facets in a row, as four cuts that open at those steps: the same motion."""
    ends = [0.0, 0.25, 0.5, 0.75, 1.0]
    path = {"kind": "tool_path", "name": "row", "points": [[0, 0.5], [1, 0.5]], "speed": 5.0}
    row = [
        {"kind": "polyline", "name": f"c{k}", "points": [[a, 0.5], [b, 0.5]], "opens_at": t}
        for k, (a, b, t) in enumerate(zip(ends, ends[1:], [0.06, 0.11, 0.16, 0.21], strict=False))
    ]
    given = {**PULLED, "mesh": {"cells": [[4, 4]]}}
    # passed at 0.055, 0.105 …: within steps of 0.01
    behind = solved(plate([{**path, "starts_at": 0.005}], **given), opening="late")
    whole = solved(plate(row, **given))
    apart = np.abs(behind.displacement - whole.displacement).max()
    assert apart < 1e-10 * np.abs(whole.displacement).max()


SLANTED = {
    "kind": "tool_path",
    "name": "stroke",
    "points": [[0.31, -0.1, 0.55], [0.47, 0.4, 0.5], [0.62, 1.1, 0.52]],
    "direction": [0.2, 0.1, 1.0],
    "depth": 0.7,
    "times": [0.02, 0.08, 0.18],
}
HANGING = {
    "supports": [{"where": "bottom", "displacement": [0, 0, 0]}],
    "loads": [{"kind": "gravity", "acceleration": [1.0, 0.5, -2.0]}],
    "initial": {"kind": "equilibrium"},
}


def test_a_block_keeps_its_energy_while_a_blade_goes_through_it():
    found = solved(solid([SLANTED], 0.2, **HANGING), scheme="energy_momentum", mesh="remeshed")
    assert int(found.notes["openings"]) >= 4
    ledger = found.ledger
    assert hidden(ledger) < 1e-10
    play = np.ptp(ledger["strain"])
    assert np.abs(ledger["algorithmic"]).max() < 1e-9 * play
    assert np.ptp(ledger["kinetic"]) > 0.05 * play


def test_a_membrane_is_cut_on_its_way_down(tmp_path):
    stroke = """
[[cuts]]
kind = "tool_path"
points = [[0.23, 0.11, 0.5], [0.41, 0.52, 0.5], [0.77, 0.63, 0.5]]
direction = [0.1, 0.0, -1.0]
depth = 2.0
times = [0.03, 0.09, 0.18]
"""
    found = moved(bowl_scene(tmp_path, 6, HANGING_SKIN, cut=stroke), scheme="energy_momentum")
    assert int(found.notes["openings"]) >= 4
    assert hidden(found.ledger) < 1e-10

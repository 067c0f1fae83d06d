"""Conformance of each method: which checks it keeps, and which it cannot."""

import pytest

from verify.conformance import State, conform

# A cut that loses material, a body without its cut and springs are wrong by construction; the
# reasons are in docs/theory/methods.md.
LOSES_MATERIAL = {
    "rigid-translation-2d", "rigid-rotation-2d", "rigid-translation-3d", "rigid-rotation-3d",
    "finite-rotation-2d", "finite-rotation-3d", "parted-3d",
    "cut-patch", "two-cuts", "energy-account", "closed-cut", "traction", "traction-3d",
    "two-materials",
}  # fmt: skip
MEETING = {"crossing-cuts", "branched-cut", "ending-cut", "crossed-interface"}
BREAKS: dict[str, set[str]] = {
    "subdivision": set(),
    "snapping": set(),
    "snapping_subdivision": set(),
    "virtual_node": set(),
    "virtual_node_arbitrary": set(),
    "removal": LOSES_MATERIAL | MEETING,
    "removal_refined": LOSES_MATERIAL | MEETING,
    "uncut": {
        "parted-3d", "free-fall", "cut-patch", "two-cuts", "energy-account", "traction",
        "traction-3d", "two-materials", "free-piece", *MEETING,
    },
    "mass_spring": {
        "cut-patch", "energy-account", "closed-cut", "traction", "traction-3d", "two-materials",
        "weight", "energy-in-motion", "work-of-supports", "crossed-interface",
    },
}  # fmt: skip


@pytest.mark.heavy
@pytest.mark.parametrize("method", BREAKS)
def test_a_method_keeps_all_checks_but_those_that_it_cannot(method):
    results = conform(method)
    broken = {result.name for result in results if result.state is State.FAIL}
    assert broken == BREAKS[method], [r for r in results if r.state is State.FAIL]


def test_some_checks_are_kept_and_some_broken():
    # the page runs virtual_node with "share"
    for method, parameters in (("removal", {}), ("virtual_node", {"weights": "whole"})):
        results = conform(method, parameters, only=["uncut-2d", "cut-patch"])
        failed = {result.name for result in results if result.state is State.FAIL}
        assert failed == {"cut-patch"}, method


@pytest.mark.parametrize("method", [name for name, broken in BREAKS.items() if not broken])
def test_freed_halves_fall_turned_ones_store_nothing_and_cuts_and_materials_stay_apart(method):
    for result in conform(
        method, only=["free-fall", "finite-rotation-2d", "two-cuts", "two-materials"]
    ):
        assert result.state is State.PASS, result

"""The solvers that come with the project keep every check that they do not refuse."""

import json
from importlib.util import find_spec

import pytest

from verify.cli import main
from verify.conformance import State, conform, exit_code_of


def test_the_compact_solver_conforms():
    results = conform("xfem")
    assert exit_code_of(results) == 0, [r for r in results if r.state is not State.PASS]
    kept = {result.name for result in results if result.state is State.PASS}
    wanted = {"cut-patch", "rigid-rotation-3d", "parted-3d", "renumbering", "mirrored-cut"}
    wanted |= {"two-materials", "two-cuts", "ending-cut", "crossed-interface"}
    wanted |= {"crossing-cuts", "branched-cut", "traction-3d"}
    wanted |= {"finite-rotation-2d", "finite-rotation-3d", "free-fall"}
    assert wanted <= kept


def test_a_ghost_penalty_keeps_two_cuts_and_two_materials():
    """It joins gradients around a cut: a right one fails if the interface is there."""
    for found in conform("xfem", {"slivers": "penalise"}, only=["two-cuts", "two-materials"]):
        assert found.state is State.PASS, found


def test_a_scheme_of_first_order_in_time_conforms_and_that_is_said():
    (found,) = conform("xfem", {"scheme": "implicit_euler"}, only=["free-fall"])
    assert found.state is State.PASS
    assert found.reason == "of first order in time"


@pytest.mark.fenicsx
@pytest.mark.skipif(find_spec("dolfinx") is None, reason="needs DOLFINx")
def test_the_conforming_solver_conforms():
    results = conform("conforming")
    assert exit_code_of(results) == 0, [r for r in results if r.state is not State.PASS]
    kept = {result.name for result in results if result.state is State.PASS}
    assert {"cut-patch", "two-materials", "two-cuts", "traction", "weight", "mirrored-cut"} <= kept
    wanted = {"crossing-cuts", "branched-cut", "ending-cut", "crossed-interface", "traction-3d"}
    assert wanted <= kept


def test_the_command_prints_the_checks_as_a_table_and_as_json(capsys):
    command = ["conform", "xfem", "--check", "uncut-2d"]
    assert main(command) == 0
    table = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in table] == [["uncut-2d", "pass"]]
    assert main([*command, "--set", "tip=through", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["parameters"] == {"tip": "through"}
    assert [check["state"] for check in said["checks"]] == ["pass"]

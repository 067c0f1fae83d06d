"""The examples of the guides to the compact solver run as printed, each page in one go."""

import doctest
import re
from importlib import import_module
from pkgutil import iter_modules

import meshio
import numpy as np
import pytest
from doc_pages import blocks

import verify.xfem as xfem


def printed_by(page, capsys):
    """What the examples of a page print; they share their names, in order."""
    names = {}
    for example in blocks(page, "python"):
        exec(compile(example, page, "exec"), names)
    return capsys.readouterr().out.splitlines()


def test_dynamics_cuts_a_moving_body_and_penalises_slivers(capsys):
    account, penalty = printed_by("theory/dynamics.md", capsys)
    off, size = re.findall(r"by (\S+) J of (\S+) J", account)[0]
    assert float(off) < 1e-10 * float(size)
    assert "faces penalised with factor 0.01" in penalty
    assert 0.0 < float(penalty.split()[-1]) < 0.1


def test_slivers_are_aggregated_and_a_penalty_does_not_change_the_answer_much(capsys):
    aggregated, energies = printed_by("theory/slivers.md", capsys)
    # of the 16 triangles above the line, 8 have an edge on it; of the others the cut leaves
    # (8e-9)² = 6e-17 of their area, which is round-off
    assert aggregated.startswith("8 slivers aggregated")
    kept, penalised = map(float, re.findall(r"(\S+) J", energies))
    assert kept > 0.0
    assert penalised == pytest.approx(kept, rel=5e-3)


@pytest.mark.heavy
def test_cutting_finds_the_tool_on_the_cut_body_and_on_the_cut_skin(capsys, tmp_path, monkeypatch):
    # the surface that the page crops: a square of 0.02 m that faces the blade
    square = (-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)
    corners = "".join(f"v {x} {y} 1.0\n" for x, y in square)
    (tmp_path / "body.obj").write_text(f"{corners}f 1 2 3 4\n")
    monkeypatch.chdir(tmp_path)
    solid, skin = (
        np.array(line.split(), dtype=float) for line in printed_by("guide/simulator.md", capsys)
    )
    assert len(meshio.read("skin.stl").cells_dict["triangle"]) == 2
    assert solid[0] > 0.0  # crossing an element takes time
    assert 0.15 < solid[1] <= 0.2 + 1e-12  # the lifted top is 0.2 below the query
    # the nearest point of the skin and what is found in the material are the same place
    assert skin[0] == pytest.approx(skin[1], rel=1e-9)


def test_what_a_user_calls_has_an_example_in_its_docstring():
    named = set(xfem.__all__) - {"XfemError"}
    assert [name for name in sorted(named) if ">>> " not in getattr(xfem, name).__doc__] == []
    assert set(re.findall(r"`(\w+)`", xfem.__doc__.partition("Example")[0])) == named


@pytest.mark.parametrize(
    "name", ["verify.xfem", *(f"verify.xfem.{one.name}" for one in iter_modules(xfem.__path__))]
)
def test_the_examples_of_docstrings_run_as_printed(name):
    failed, _ = doctest.testmod(import_module(name))
    assert failed == 0

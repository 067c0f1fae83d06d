"""The program for SOFA, where SOFA is not: a stand-in moves the graph that the program builds.

The stand-in integrates with the scheme of the compact solver, and is held against where SOFA had
the beam. What is tested is the program: mesh, material, mass, forces, supports and steps that it
hands to SOFA, and the answer that it writes.
"""

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import meshio
import numpy as np
import pytest

from verify.exchange import export_case, read_answers
from verify.foreign.installing import PROGRAMS
from verify.scene import load_scene
from verify.xfem.body import DynamicBody
from verify.xfem.element import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler

ROOT = Path(__file__).resolve().parents[2]


class Node:
    """A node of the graph: what was added to it, by the name of the component."""

    def __init__(self, name):
        self.name, self.objects, self.children = name, {}, []
        self.dt = SimpleNamespace(value=None)

    def addObject(self, kind, **data):
        values = {key: SimpleNamespace(value=value) for key, value in data.items()}
        self.objects[kind] = SimpleNamespace(**values)
        return self.objects[kind]

    def addChild(self, name):
        self.children.append(Node(name))
        return self.children[-1]


def init(root):
    parts = root.children[0].objects
    topology, force = parts["TetrahedronSetTopologyContainer"], parts["ConstantForceField"]
    law, points = (
        parts["FastTetrahedralCorotationalForceField"],
        parts["MechanicalObject"].rest_position.value,
    )
    held, mass = parts["PartialFixedProjectiveConstraint"], parts["DiagonalMass"].vertexMass.value
    assert (law.template.value, law.method.value) == ("Vec3d", "polar")
    assert np.ptp(law.youngModulus.value) < 1e-10 * law.youngModulus.value[0]
    np.testing.assert_array_equal(force.indices.value, np.arange(len(points)))
    np.testing.assert_array_equal(held.fixedDirections.value, [1, 1, 1])
    mesh = cut_mesh(SimplexMesh(points, topology.tetrahedra.value), [])
    lumped = side_wise_mass(mesh, mass[0] / side_wise_mass(mesh, 1.0).weights[0])
    np.testing.assert_allclose(mass, lumped.weights, rtol=1e-12)
    body = DynamicBody(
        InternalForce(
            mesh, isotropic(law.youngModulus.value[0], law.poissonRatio.value[0], "solid")
        ),
        lumped,
        weight=force.forces.value,
        supports=Supports.none(mesh).prescribe(mesh, held.indices.value),
    )
    root.body, root.moved = body, body.rest()


def animate(root, dt):
    state = root.children[0].objects["MechanicalObject"]
    RealTimeEuler(root.body, dt).advance(root.moved)
    state.position.value = state.rest_position.value + root.moved.displacement
    state.velocity.value = root.moved.velocity


@pytest.fixture
def missing(request):
    """Module of SOFA that cannot be loaded; by default none."""
    return getattr(request, "param", None)


@pytest.fixture
def program(monkeypatch, missing):
    sofa, runtime = ModuleType("Sofa"), ModuleType("SofaRuntime")
    sofa.GetVersion, sofa.Core = lambda: "stand-in", SimpleNamespace(Node=Node)
    sofa.Simulation = SimpleNamespace(initRoot=init, animate=animate, unload=lambda root: None)
    runtime.importPlugin = lambda name: name != missing
    monkeypatch.setitem(sys.modules, "Sofa", sofa)
    monkeypatch.setitem(sys.modules, "SofaRuntime", runtime)
    monkeypatch.syspath_prepend(PROGRAMS)
    spec = importlib.util.spec_from_file_location("sofa_program", PROGRAMS / "sofa/program.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    for name in ("exchange_files", "motion"):
        sys.modules.pop(name, None)


def test_the_program_moves_the_beam_of_the_record_as_sofa_did(program, tmp_path):
    with np.load(ROOT / "tests/xfem/sofa/beam200.npz") as beam:
        nodes, tetrahedra, tip = beam["nodes"], beam["tets"], beam["tip"]
    meshio.Mesh(nodes, [("tetra", tetrahedra)]).write(tmp_path / "soft_beam.mesh")
    text = (ROOT / "docs/examples/soft_beam.toml").read_text().replace("1.0e5", "1.0e4")
    (tmp_path / "beam.toml").write_text(text)
    scene = load_scene(str(tmp_path / "beam.toml"))
    export_case(scene, tmp_path / "out", conforming=True)
    case = program.run.__globals__["Case"](tmp_path / "out", 0, conforming=True)
    case.parameters = {"scheme": "euler"}
    program.solve(case)
    found = read_answers(scene, tmp_path / "out").solutions[0]
    assert found.displacement[-1][tip, 1].mean() == pytest.approx(-0.0619945794431326, abs=1e-11)
    answer = json.loads((tmp_path / "out/level-0/solution.json").read_text())
    assert answer["iterations"] == {"steps": 100}


@pytest.mark.parametrize("missing", ["Sofa.Component.Mass"], indirect=True)
def test_a_module_that_cannot_be_loaded_is_named(program, missing):
    with pytest.raises(RuntimeError, match=f"SOFA has no {missing}: set SOFA_ROOT"):
        program.solve(None)

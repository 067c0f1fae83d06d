"""Two MPI ranks give the answers of one, the one that this process is: at rest and in motion."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from verify.errors import InputError
from verify.runner.ranks import AT_HOME, mpiexec

pytestmark = needs_fenicsx

HERE = Path(__file__).parent
_BEFORE = """
import pickle, sys
sys.path[:0] = {tests!r}
"""
_ANSWERS = """
from reference.installation import import_dolfinx
import_dolfinx()
import numpy as np
from mpi4py import MPI
world = MPI.COMM_WORLD

import test_motion
import reference.large_strain
from test_solid_elasticity import answer_on, hanging
from reference.boundary_conditions import constrained_values, load_forces
from reference.large_strain import solve_large_strain
from reference.space import conforming_space
from verify.compare.locate import SolutionField
from verify.solvers import find_solver
from verify.solvers.conforming_meshes import peer_mesh

def turned():
    "At finite rotation by multigrid on two ranks, and by a factorisation on one."
    direct = reference.large_strain._MOST_DIRECT
    if world.size > 1:
        reference.large_strain._MOST_DIRECT = 0
    scene = hanging([])
    space = conforming_space(peer_mesh(scene, 0, "imprinted"), 1, world)
    found = solve_large_strain(
        scene.material, space, constrained_values(scene, space, None)[0],
        lambda factor: constrained_values(scene, space, None, factor)[1],
        load_forces(scene, space, None))
    reference.large_strain._MOST_DIRECT = direct
    return [found.strain_energy, found.orientation.least, float(np.linalg.norm(found.displacement))]

def plane(kinematics):
    "A square that is pulled, turned and damped: one cut open before, one at 0, one on the way."
    cuts = [test_motion.polyline("before", [-0.1, 0.8], [0.3, 0.8]),
            test_motion.polyline("slanted", [0.4, 0.75], [1.1, 0.65]),
            {**test_motion.MIDDLE, "opens_at": 0.025}]
    scene = test_motion.moving(
        cuts, kinematics, duration=0.05, outputs=3,
        supports=[{"where": "bottom", "displacement": [0.1, 0.0],
                   "history": [[0.0, 0.0], [0.03, 1.0]]},
                  {"where": "left", "displacement": [0.0], "components": ["x"]}],
        loads=[{"kind": "gravity", "acceleration": [0, -0.98]},
               {"kind": "traction", "where": "top", "traction": [100.0, 200.0],
                "history": [[0.0, 1.0], [0.02, 0.0]]}],
        initial={"kind": "equilibrium", "cuts": "closed"})
    damped = scene.analysis.model_copy(update={"damping": (1.0, 1e-3)})
    return scene.model_copy(update={"analysis": damped})

def squeezed():
    "A nearly incompressible block with a slit that opens on the way."
    slit = {**test_motion.polyline("slit", [0.5, 0.4], [0.5, 1.1]), "opens_at": 0.02}
    return test_motion.moving(
        [slit], duration=0.04, outputs=3, reference={"size": 0.5},
        material={"young": 1e4, "poisson": 0.4999, "plane": "strain", "density": 1000.0},
        supports=[{"where": "bottom", "displacement": [0, 0]}],
        loads=[{"kind": "traction", "where": "top", "traction": [50.0, -200.0]}])

rest = [
    answer_on(world, 1, "direct", 0.3), answer_on(world, 2, "multigrid", 0.6),
    answer_on(world, 2, "multigrid", 0.8, pressure=True), turned(),
]
motions = {}
for name, scene, solver, given in [
    ("linear", plane("linear"), "conforming", {"scheme": "generalised_alpha", "degree": 2}),
    ("turning", plane("corotational"), "conforming", {"scheme": "energy_momentum"}),
    ("pressure", squeezed(), "reference", {}),
]:
    points = np.random.default_rng(1).random((300, scene.dimension))
    found = find_solver(solver).solve(scene, 0, 0, **given)
    fields = [SolutionField(found, t).displacement(points) for t in range(len(found.times))]
    # on all ranks alike: they need no talk to take the same steps
    sums = world.allgather(float(np.sum(found.displacement)))
    assert len(set(sums)) == 1
    assert ("pressure" in found.notes["unknowns"]) == (name == "pressure")
    motions[name] = found.ledger, np.array(fields), found.iterations
"""
_AFTER = """
if world.rank == 0:
    with open({out!r}, "wb") as file:
        pickle.dump((world.size, rest, motions), file)
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Answers at rest, and in motion: of this process, and of the first of two ranks."""
    here = {}
    exec(_ANSWERS, here)
    assert here["world"].size == 1
    try:
        launcher = mpiexec()
    except InputError as error:
        pytest.skip(str(error))
    out = tmp_path_factory.mktemp("ranks") / "answer.pickle"
    before, after = _BEFORE.format(tests=[str(HERE), str(HERE.parent)]), _AFTER.format(out=str(out))
    done = subprocess.run(
        [launcher, "-n", "2", sys.executable, "-c", f"{before}\n{_ANSWERS}\n{after}"],
        capture_output=True,
        text=True,
        cwd=HERE.parents[1],
        env={**os.environ, **AT_HOME},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    size, *two = pickle.loads(out.read_bytes())
    assert size == 2
    return list(zip((here["rest"], here["motions"]), two, strict=True))


def test_two_ranks_give_the_answer_of_one(answers):
    # multigrid leaves a residual of 1e-10, of which the energy is off by less; Newton 1e-11
    for alone, shared, tolerance in zip(*answers[0], (1e-10, 1e-10, 1e-8, 1e-9), strict=True):
        assert shared == pytest.approx(alone, rel=tolerance)


def test_two_ranks_move_every_point_as_one_does_and_keep_the_account(answers):
    one, two = answers[1]
    assert len(one) == 3
    for motion, (ledger, fields, iterations) in one.items():
        assert np.abs(fields[-1] - fields[0]).max() > 1e-3, motion
        # Newton's residual is 1e-11 of the forces, and most steps end far below it
        assert two[motion][1] == pytest.approx(fields, abs=1e-10 * np.abs(fields).max()), motion
        assert two[motion][2] == iterations, motion
        energy = max(np.abs(ledger[name]).max() for name in ("kinetic", "strain", "gravity"))
        for name, column in ledger.items():
            size = np.abs(column).max() if "momentum" in name else energy
            assert two[motion][0][name] == pytest.approx(column, abs=1e-10 * size), (motion, name)

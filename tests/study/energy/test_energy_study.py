"""The inertia of freed halves, and what is accepted of the accounts of spinning bodies."""

import numpy as np
import pytest

from verify.result import Verdict
from verify.study.energy.free_fall import apparent_gravity, fall
from verify.study.energy.pieces import piece_inertias
from verify.study.energy.spinning import SCHEMES, spin
from verify.study.energy.study import energy_study, judged
from verify.xfem.cuts import Plane
from verify.xfem.mass import side_wise_mass
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.virtual import cut_mesh


@pytest.fixture(scope="module")
def study():
    return energy_study(quick=True)


def test_with_the_thesis_lumping_a_freed_half_falls_with_8_757(study):
    """Formulation: −8.757 for −9.8; side-wise and consistent mass exact."""
    assert apparent_gravity("thesis") == pytest.approx(-8.757, abs=5e-4)
    for lumping in ("side-wise", "consistent"):
        for entry in (g for g in study.gravity if g["lumping"] == lumping):
            assert entry["value"] == pytest.approx(-9.8, abs=1e-9)


def test_the_missing_energy_is_the_defect_of_the_acceleration():
    """E_kin = ½ m (a t)² of the work m g ½ a t²: the share a/g is there, 1 − a/g is missing."""
    one = fall("thesis", "central differences")
    assert one.gravity == pytest.approx(-8.757, abs=5e-3)  # elastic strain g ρ L/E = 1e-4
    assert one.missing == pytest.approx(1.0 - 8.757 / 9.8, abs=3e-3)
    assert one.own_balance < 1e-12
    assert fall("side-wise", "central differences").missing == pytest.approx(0.0, abs=1e-9)


def test_the_finding_names_the_defect_and_rejects_it(study):
    verdicts = {f.topic: f for f in study.findings}
    thesis = verdicts["inertia of a freed half, thesis"]
    assert "−8.757" in thesis.sentence
    assert "dynamics/freed_half --solver xfem --set xfem.mass=thesis" in thesis.sentence
    assert thesis.verdict is Verdict.FAIL
    assert verdicts["inertia of a freed half, side-wise"].verdict is Verdict.PASS


def test_schemes_are_accepted_and_rejected_as_their_theory_says(study):
    verdicts = {f.topic: f.verdict for f in study.findings}
    kinds = {s.scheme: s.drift.kind if s.drift else "ended" for s in study.spins}
    assert kinds["energy–momentum"] == "kept"
    assert kinds["central differences"] == "bounded oscillation"
    assert kinds["implicit Euler"] == "secular loss"
    assert kinds["linearised implicit Euler"] == "secular loss"
    assert kinds["forward Euler"] == "ended"
    for scheme in ("energy–momentum", "central differences"):
        assert verdicts[f"energy, {scheme}"] is Verdict.PASS
    for scheme in ("forward Euler", "implicit Euler"):
        assert verdicts[f"energy, {scheme}"] is Verdict.FAIL
    for topic in ("momentum", "balance", "insertion of a cut", "mass and inertia of the pieces"):
        assert verdicts[topic] is Verdict.PASS, topic


def test_a_cut_changes_neither_energy_nor_momenta():
    one = spin("central differences", 12)
    assert len(one.jumps) == 2
    for jump in one.jumps:
        assert max(abs(jump.energy), jump.momentum, jump.angular_momentum) < 1e-13
    assert set(one.curves) == {"time", "kinetic", "strain", "mechanical", "algorithmic"}
    assert one.scheme in SCHEMES


@pytest.mark.parametrize("dim", [2, 3])
def test_pieces_have_their_masses_and_their_inertia_to_second_order(dim):
    """Exact inertia of a cuboid; the error of lumping falls by 4 when h is halved."""
    normal = np.eye(dim)[-1]
    level = 0.5 + 1.0 / 24.0
    errors = []
    for count in (4, 8):
        mesh = rectangle_mesh((count,) * 2) if dim == 2 else box_mesh((count,) * 3)
        virtual = cut_mesh(mesh, [Plane(level * normal, normal)])
        lower, upper = sorted(
            piece_inertias(virtual, side_wise_mass(virtual, 3.0), 3.0), key=lambda p: -p.mass
        )
        assert lower.exact_mass == pytest.approx(3.0 * level, rel=1e-12)
        assert lower.mass == pytest.approx(lower.exact_mass, rel=1e-12)
        assert upper.acceleration == pytest.approx(1.0, rel=1e-12)
        # in the plane the cut shortens y; in space it does not shorten the plane of rotation
        sides = (1.0, level) if dim == 2 else (1.0, 1.0)
        exact = 3.0 * level * (sides[0] ** 2 + sides[1] ** 2) / 12.0
        assert lower.exact_turning == pytest.approx(exact, rel=1e-12)
        errors.append(lower.turning / exact - 1.0)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize(
    ("value", "uncertainty", "verdict"),
    [(0.5, 0.1, "PASS"), (0.95, 0.1, "UNDECIDED"), (-1.05, 0.1, "UNDECIDED"), (-2.0, 0.1, "FAIL")],
)
def test_a_limit_inside_the_uncertainty_is_undecided(value, uncertainty, verdict):
    assert judged(value, uncertainty, 1.0) == verdict

"""Energies are measured: whoever lies about them is found out, and an honest lumped mass is not."""

from dataclasses import replace
from itertools import product
from math import factorial, prod

import numpy as np
import pytest
from cut_meshes import grid, quadratic
from judged_fields import judged
from lying_solvers import PARTS, faster, hidden
from scipy.linalg import eigvalsh
from solid_meshes import cube_grid

from verify.compare.hooke import law_of
from verify.compare.mass import consistent_mass, lumped_shares, lumping_range
from verify.compare.motion_account import motion_account
from verify.compare.part_account import account_metrics
from verify.compare.simplices import simplices
from verify.conformance import scenes
from verify.result import Verdict
from verify.scene import Scene
from verify.scene.loading import load_scene
from verify.scene.physics import field_values
from verify.solution import Solution
from verify.solvers.interface import find_solver
from verify.solvers.xfem import XfemSolver
from verify.study.measured_scenes import AT_MOST, Measurement, account_findings

DRIFT = {"check": "error", "metric": "energy_drift", "at_most": 4e-3}


@pytest.fixture(scope="module")
def plate():
    """A plate that is cut while it vibrates, and an honest lumped answer."""
    case = load_scene("dynamics/plate_cut_vibrating")
    return case, XfemSolver().solve(case, 0, 0, mass="sidewise")


def judged_by(case, solution, check=DRIFT):
    """Judge a copy of the case with that one check."""
    asked = case.model_dump(mode="json", by_alias=True) | {"acceptance": [check]}
    return judged(Scene.model_validate(asked), {"xfem": {0: solution}})


def judgement_of(case, solution, check=DRIFT):
    """Verdict and record of a copy of the case with that one check."""
    found = judged_by(case, solution, check)
    return found.verdicts[0].verdict, found.solves[0]


def verdict_of(case, solution, check=DRIFT):
    return judgement_of(case, solution, check)[0]


def energies_of(case, solution):
    metrics, notes = account_metrics(case, motion_account(case, solution, law_of(case)))
    return {metric.name: metric for metric in metrics}, notes


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_lumping_changes_the_kinetic_energy_by_a_factor_in_the_range_of_a_cell(d, order):
    """[1, d + 2] of linear simplices, however their nodes lie: of a whole mesh, by eigenvalues.

    Quadratic ones may lose energy too. Cells of a cut cell are cells: the mass of a part that is
    lumped at the corners of the whole cell is not that of any of them, and has no such bound.
    """
    points, cells = grid(3, 2) if d == 2 else cube_grid(1, 2, 1)
    points = points + 0.06 * np.random.default_rng(5).normal(size=points.shape)
    if order == 2:
        points, cells = quadratic(points, cells)
    still = np.zeros((1, *points.shape))
    volume = simplices(points, cells).volume
    low, high = lumping_range(d, order)
    if order == 1:
        assert (low, high) == pytest.approx((1.0, d + 2.0), rel=1e-12)
    lumped, consistent = np.zeros((2, len(points), len(points)))
    for nodes, size in zip(cells, volume, strict=True):
        lumped[nodes, nodes] += size * lumped_shares(d, order)
        consistent[np.ix_(nodes, nodes)] += size * cell_mass(d, order)
    ratios = eigvalsh(lumped, consistent)
    assert ratios.min() >= low - 1e-12
    assert ratios.max() <= high + 1e-12
    one = Solution(points, cells, still, order=order)
    assert consistent_mass(one, 1.0).toarray() == pytest.approx(consistent, abs=1e-15)


def cell_mass(d, order):
    """Consistent mass of a cell of mass 1: integrals of monomials λ^a are a! d!/(|a| + d)!."""
    unit = np.eye(d + 1, dtype=int)
    hats = [[(1.0, one)] for one in unit]
    if order == 2:
        corners = [[(2.0, 2 * one), (-1.0, one)] for one in unit]
        ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)][: d * (d + 1) // 2]
        hats = [*corners, *([(4.0, unit[a] + unit[b])] for a, b in ends)]

    def integral(powers):
        return prod(map(factorial, powers)) * factorial(d) / factorial(sum(powers) + d)

    return np.array([
        [sum(c * e * integral(a + b) for (c, a), (e, b) in product(one, other)) for other in hats]
        for one in hats
    ])  # fmt: skip


@pytest.mark.parametrize("part", [*PARTS, None])
def test_a_gain_that_is_hidden_in_any_part_of_a_ledger_is_found(plate, part):
    """Velocities of five times the kinetic energy at the end, and a ledger that closes.

    Without a ledger, and without a declared mass, it is found as well: lumping is no such factor.
    A ledger that says that the scheme gained it is right, and the energy is not kept.
    """
    case, honest = plate
    liar = faster(honest, 5.0) if part is None else hidden(honest, 5.0, part)
    liar = replace(liar, ledger={}) if part is None else liar
    assert verdict_of(case, replace(liar, mass=None)) is Verdict.FAIL
    if part in (None, "algorithmic"):
        return
    found, notes = energies_of(case, liar)
    mismatch = found["ledger_mismatch"]
    assert mismatch.value - mismatch.uncertainty > 0.5
    assert part.replace("_", " ") in notes["ledger"]


@pytest.mark.parametrize("mass, said", [
    (lambda one: 0.2 * one.mass, "total, first moments or parts are off by 0.8"),
    (lambda one: np.roll(np.asarray(one.mass.sum(axis=1)).ravel(), 1), "off by"),
])  # fmt: skip
def test_a_mass_that_is_not_of_the_body_is_not_taken(plate, mass, said):
    case, honest = plate
    found, _ = energies_of(case, replace(honest, mass=mass(honest)))
    assert "the declared mass is not taken" in found["energy_drift"].source
    assert said in found["energy_drift"].source


def test_a_mass_with_more_energy_than_any_lumping_is_not_taken(plate):
    """Total and moments are right: what is added is nothing for a motion that is affine."""
    case, honest = plate
    points = np.column_stack([np.ones(len(honest.points)), honest.points])
    basis = np.linalg.qr(points)[0]
    more = np.eye(len(points)) - basis @ basis.T
    heavy = honest.mass + type(honest.mass)(20.0 * honest.mass.max() * more)
    found, _ = energies_of(case, replace(honest, mass=heavy))
    assert "lumping makes 1 to 4 of it" in found["energy_drift"].source


def test_an_honest_mass_that_is_not_declared_is_within_the_interval(plate):
    """With the consistent mass of its field an honest lumped answer drifts; not surely so."""
    case, honest = plate
    found, _ = energies_of(case, replace(honest, mass=None))
    drift = found["energy_drift"]
    assert "no mass is declared" in drift.source
    assert 1e-6 < drift.value <= drift.uncertainty
    assert "(no mass is declared); expected the `mass` of the solution" in drift.width_from
    check = {**DRIFT, "at_most": 1e-6}
    (found,) = judged_by(case, replace(honest, mass=None), check).verdicts
    assert found.verdict is Verdict.UNDECIDED
    assert "reference" not in found.reason
    assert drift.width_from in found.reason
    assert verdict_of(case, honest, {**DRIFT, "at_most": 1e-6}) is Verdict.PASS


def swinging(**changes):
    """Give the scene of the suite that swings under its weight other parts."""
    content = scenes.swinging().model_dump(mode="json", by_alias=True)
    analysis = {**content["analysis"], **changes.pop("analysis", {})}
    return Scene.model_validate(content | {"analysis": analysis} | changes)


def test_what_damping_takes_is_known_from_its_rate_at_the_output_times():
    """Half as much kinetic energy again that hides in damping is seen; the true loss is kept."""
    case = swinging(
        # 80 outputs to a period of the lowest mode: 60 do not tell what shorter waves lose to 0.5 %
        analysis={"damping": [0.05, 0.03], "kinematics": "corotational", "outputs": 121},
        loads=[{"kind": "gravity", "acceleration": [0.2, -0.1]}],
    )
    honest = XfemSolver().solve(case, 0, 0)
    assert honest.ledger["damping"][-1] > 0.1 * np.ptp(honest.ledger["gravity"])
    check = {**DRIFT, "at_most": 5e-3}
    assert verdict_of(case, honest, check) is Verdict.PASS
    found, _ = energies_of(case, honest)
    mismatch = found["ledger_mismatch"]
    assert mismatch.value <= mismatch.uncertainty + 1e-5
    assert verdict_of(case, hidden(honest, 1.5, "damping"), check) is Verdict.FAIL


SLIDES = [{"where": "bottom", "displacement": [0.05, 0.0], "history": [[0.0, 0.0], [3.9, 1.0]]}]
SHEARS = [
    {"where": "bottom", "displacement": [0.0, 0.0]},
    {"where": "left", "components": ["x"], "displacement": ["0.05 * y * sin(0.5 * t)"]},
]
TURN = {"angle": 40.0, "centre": [0.5, 0.0]}
SPIN = {"angle": 80.0, "centre": [0.5, 0.5, 0.0], "axis": [0.2, 0.0, 1.0]}
TURNS = [[0.0, 0.0], [3.0, 0.3], [10.0, 1.0]]
WEDGE = [[0.41, -0.1, 0.3], [0.41, 1.1, 0.3], [1.2, 1.1, 0.62], [1.2, -0.1, 0.62]]
LARGE = {"kinematics": "corotational"}
MOVED = {
    "slides": {"supports": SLIDES},
    "shears": {"supports": SHEARS},
    "turns": {
        "supports": [
            {"where": "bottom", "displacement": [0.0, 0.0], "rotation": TURN, "history": TURNS}
        ],
        "analysis": LARGE,
    },
    "turns in space": {
        **scenes.in_space([{"kind": "polygon", "points": WEDGE}]),
        "loads": [{"kind": "gravity", "acceleration": [0.02, -0.01, 0.0]}],
        "supports": [
            {"where": "bottom", "displacement": [0.0] * 3, "rotation": SPIN, "history": TURNS}
        ],
        "analysis": LARGE,
    },
}


@pytest.mark.parametrize("name, moved", [
    ("xfem", "slides"), ("conforming", "shears"), ("snapping", "turns"), ("xfem", "turns in space"),
])  # fmt: skip
def test_a_gain_hidden_in_the_work_of_supports_that_move_fails(name, moved):
    """Half as much kinetic energy again; the honest work is known to a thousandth and passes."""
    case = swinging(**MOVED[moved])
    honest = find_solver(name).solve(case, 0, 0)
    assert np.ptp(honest.ledger["work_of_supports"]) > 0.05 * honest.ledger["kinetic"].max()
    verdict, record = judgement_of(case, honest)
    drift = record.metric("energy_drift")
    assert verdict is Verdict.PASS
    assert drift.value + drift.uncertainty < 2e-3
    assert "work_of_supports" not in record.notes  # nobody's word
    verdict, record = judgement_of(case, hidden(honest, 1.5, "work_of_supports"))
    assert verdict is Verdict.FAIL
    assert "work of supports" in record.notes["ledger"]


def test_output_times_that_do_not_resolve_a_motion_leave_it_undecided():
    case = swinging(supports=SHEARS, analysis={"outputs": 6})
    assert verdict_of(case, XfemSolver().solve(case, 0, 0)) is Verdict.UNDECIDED


def test_the_work_of_supports_that_jump_is_a_word_and_no_verdict_rests_on_it():
    jumps = {**SLIDES[0], "history": [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0]]}
    case = swinging(supports=[jumps])
    honest = XfemSolver().solve(case, 0, 0)
    for one in (honest, hidden(honest, 1.5, "work_of_supports")):
        assert verdict_of(case, one) is Verdict.UNDECIDED
        assert energies_of(case, one)[1]["work_of_supports"].endswith("it is the solver's word")
    held = swinging()
    still = hidden(XfemSolver().solve(held, 0, 0), 1.5, "work_of_supports")
    assert verdict_of(held, still) is Verdict.FAIL  # supports that stand still do no work


def test_work_of_supports_with_a_kink_at_each_output_time_is_a_word():
    """No two intervals make a longer one, so nothing tells the error of the work."""
    table = [[t, t * (20.0 - t) / 100.0] for t in np.linspace(0.0, 9.0, 7)]
    pulled = {"where": "left", "components": ["x"], "displacement": [0.3], "history": table}
    case = swinging(supports=[SHEARS[0], pulled], analysis={"duration": 9.0, "outputs": 7})
    honest = XfemSolver().solve(case, 0, 0)
    found, sources = energies_of(case, honest)
    assert "kink" in sources["work_of_supports"]
    assert found["energy_drift"].value < 1e-10  # as it is, without the interpolated rest
    (verdict,) = judged_by(case, honest).verdicts
    assert verdict.verdict is Verdict.UNDECIDED
    said = f"it is from the work of supports: {sources['work_of_supports']}"
    assert said in verdict.reason


def test_work_of_supports_with_kinks_between_output_times_has_what_is_taken_up_at_once():
    """Material beside a support takes up its velocity with it: a jump that no cubic has."""
    table = [[0.0, 0.0], [2.17, 1.0], [4.41, -0.4]]
    case = swinging(supports=[{**SLIDES[0], "displacement": [0.2, 0.05], "history": table}],
                    analysis={"outputs": 61})  # fmt: skip
    drift = energies_of(case, XfemSolver().solve(case, 0, 0))[0]["energy_drift"]
    assert drift.value < 2e-3  # of the energy in play, which the scheme keeps
    assert drift.value < drift.uncertainty < 0.02
    assert drift.width_from.startswith("the work of supports between outputs")


CURVED = {
    2: ["3 * x * x - 3 * y * y", "-6 * x * y"],
    3: ["3 * x * x - 3 * y * y", "-6 * x * y", "0"],
}
LINES = ["0.3 * x + 0.2 * z", "0.1 * y - 0.4 * x", "0.2 * z + 0.1 * y"]


@pytest.mark.parametrize(("field", "d"), [("finite", 3), ("curved", 2), ("curved", 3)])
def test_a_motion_in_equilibrium_takes_from_its_supports_what_it_stores(d, field):
    """Displacements in equilibrium that grow evenly: the work of supports is the strain energy.

    Affine ones are, in either kinematics; and gradients of harmonic polynomials with linear ones,
    of which quadratic elements have those of degree three.
    """
    points, cells = grid(4, 3) if d == 2 else cube_grid(2, 2, 2)
    inner = ((points > 0.0) & (points < 1.0)).all(axis=1)
    points[inner] += 0.05 * np.random.default_rng(3).normal(size=points.shape)[inner]
    if field == "curved":
        points, cells = quadratic(points, cells)
        points, first = np.unique(np.round(points, 12), axis=0, return_inverse=True)
        cells = first.ravel()[cells]
    formulas = CURVED[d] if field == "curved" else LINES
    parts = scenes.in_space([]) if d == 3 else {"cuts": []}
    pushed = {"where": "boundary", "displacement": formulas, "history": [[0.0, 0.0], [10.0, 1.0]]}
    large = {"kinematics": "corotational" if field == "finite" else "linear"}
    case = swinging(**parts, supports=[pushed], loads=[], analysis=large)
    times = np.linspace(0.0, 9.0, 7)
    v = field_values(formulas, points) / 10.0
    u = np.multiply.outer(times, v)
    one = Solution(
        points, cells.astype(np.int64), u, times, 2 if field == "curved" else 1,
        velocity=np.array([v] * 7), mass="consistent",
    )  # fmt: skip
    energies = motion_account(case, one, law_of(case)).energies
    work, stored = energies.parts["work_of_supports"], energies.parts["strain"]
    assert stored[-1] > 0.0
    exact = 1e-6 if field == "finite" else 1e-10  # of four points to a step
    assert np.abs(work - stored).max() <= exact * stored[-1]
    assert energies.width.max() <= 1e3 * exact * stored[-1]


@pytest.mark.parametrize("rows, verdict", [
    ([(0.004, 0.009), (0.002, 0.002)], Verdict.PASS),
    ([(0.02, 0.02), (0.004, 0.05)], Verdict.FAIL),  # the first is above the limit for certain
    ([(0.004, 0.05), (0.001, 0.001)], Verdict.UNDECIDED),
])  # fmt: skip
def test_a_study_knows_the_intervals_of_energies(rows, verdict):
    own = [
        Measurement("a case", float(row), "a", name, "", value)
        for row, values in enumerate(rows)
        for name, value in zip(("energy_drift", AT_MOST), values, strict=True)
    ]
    (found,) = account_findings("a case", own)
    assert found.verdict is verdict

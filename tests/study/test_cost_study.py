"""Studies of cost: solvers of known cost, growing cuts; bars of the reference."""

import math
import signal
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from reference.exact.moving_cracks import wave
from verify.cli import main
from verify.errors import RunStoppedError
from verify.judge.cost import paid_times, pareto_front, time_at, work_points
from verify.result import (
    CaseResult,
    Metric,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    meshes_charged,
)
from verify.scene import load_scene
from verify.study import study
from verify.study.calibration import (
    Trial,
    binomial_tail,
    calibration_findings,
    families,
    series_families,
    trials,
)
from verify.study.calibration_scenes import released, stretched
from verify.study.cost import cost_study, growing_scenes

STRIP = "statics/tissue_strip"


def solve(
    solver, level, error, seconds, spread=0.0, status=Status.SOLVED, meshing=0.0, conforming=None
):
    metrics = [Metric("energy_norm", error, "1")] if status is Status.SOLVED else []
    timings = {"solve": [seconds * (1 - spread), seconds, seconds * (1 + spread)]}
    if meshing:
        timings["meshing"] = [meshing] * 3
    return SolveRecord(
        "case", solver, level, status, "" if status is Status.SOLVED else "it broke",
        metrics=metrics, timings=timings, unknowns=100 * 4**level, conforming=conforming,
    )  # fmt: skip


def result(*solves):
    return CaseResult("case", "", "", "", {}, ReferenceRecord(), list(solves), [], [])


def ladder(solver, error, seconds, order=1.0, **others):
    """Levels of half the size each: error falls with `order`, time grows fourfold."""
    return [
        solve(solver, k, error * 2.0 ** (-order * k), seconds * 4.0**k, **others) for k in range(3)
    ]


def test_the_time_of_an_error_between_levels_is_that_of_the_power_law():
    points = work_points(ladder("one", 0.4, 0.01), "energy_norm")
    # error e takes 0.01 (0.4/e)²
    for error in (0.4, 0.3, 0.123, 0.1):
        assert time_at(points, error)[0] == pytest.approx(0.01 * (0.4 / error) ** 2, rel=1e-12)
    assert time_at(points, 0.5)[0] == pytest.approx(0.01)  # the coarsest does it
    assert time_at(points, 0.09) is None
    # a level without any error has no place on a scale of logarithms
    exact = work_points([*ladder("one", 0.4, 0.01), solve("one", 3, 0.0, 1.0)], "energy_norm")
    assert time_at(exact, 0.3) == time_at(points, 0.3)
    assert time_at(exact, 0.09) is None


def test_a_solver_ten_times_slower_at_equal_accuracy_is_said_to_be_that():
    steps = [result(*ladder("xfem", 0.4, 0.01), *ladder("other", 0.4, 0.1))] * 3
    study = cost_study("case", steps, "energy_norm")
    assert study.running["xfem"][-1][0] == pytest.approx(3 * 0.16)
    (finding,) = [f for f in study.findings if f.topic.endswith(", other")]
    assert "10 times as much" in finding.sentence
    assert finding.verdict is Verdict.PASS
    (front,) = [f for f in study.findings if f.topic.startswith("Pareto")]
    assert (front.expected, front.verdict) == ("shown, not judged", None)


def test_a_faster_solver_of_lower_order_is_compared_at_the_error_that_both_reach():
    """Ten times faster per level, but of order ½: at the common error it is the slower."""
    steps = [result(*ladder("xfem", 0.4, 0.01), *ladder("hasty", 0.4, 0.001, order=0.5))]
    study = cost_study("case", steps, "energy_norm")
    assert study.steps[0]["error"] == pytest.approx(0.2)  # hasty's best
    xfem, hasty = (study.steps[0]["times"][name][0] for name in ("xfem", "hasty"))
    assert (xfem, hasty) == (pytest.approx(0.04), pytest.approx(0.016))


def test_what_lies_within_the_spread_is_undecided():
    steps = [result(*ladder("xfem", 0.4, 0.01, spread=0.3), *ladder("o", 0.4, 0.012, spread=0.3))]
    study = cost_study("case", steps, "energy_norm")
    assert study.findings[0].verdict is Verdict.UNDECIDED


def test_a_background_mesh_is_paid_once_and_a_conforming_one_at_every_step():
    one = result(
        *ladder("one", 0.4, 0.01, meshing=1.0, conforming=False),
        *ladder("other", 0.4, 0.01, meshing=1.0, conforming=True),
    )
    study = cost_study("case", [one] * 4, "energy_norm")
    assert study.running["one"][-1][0] == pytest.approx(1.0 + 4 * 0.16)
    assert study.running["other"][-1][0] == pytest.approx(4 * 1.16)


def test_who_is_handed_a_mesh_that_conforms_to_the_cut_pays_for_its_making():
    maker = ladder("maker", 0.4, 0.01, meshing=2.0, conforming=True)
    guest = ladder("guest", 0.4, 0.01, conforming=True)
    others = [
        *ladder("background", 0.4, 0.01, conforming=False),
        *(replace(s, timings={**s.timings, "meshing": [1.0] * 3, "cutting": [0.5] * 3})
          for s in ladder("splitter", 0.4, 0.01, conforming=True)),
    ]  # fmt: skip
    charged = meshes_charged([*maker, *guest, *others])
    paid = {(r.solver, r.level): paid_times(r)[1] for r in charged}
    for level in range(3):
        own = 0.01 * 4.0**level
        assert paid["maker", level] == pytest.approx(2.0 + own)
        assert paid["guest", level] == pytest.approx(2.0 + own)
        assert paid["background", level] == pytest.approx(own)
        assert paid["splitter", level] == pytest.approx(0.5 + own)
    # `conforming` says the time, whichever solvers make such a mesh and in any order
    known = ladder("conforming", 0.4, 0.01, meshing=3.0, conforming=True)
    for records in ([*known, *maker, *guest], [*guest, *maker, *known]):
        paid = {(r.solver, r.level): paid_times(r) for r in meshes_charged(records)}
        assert paid["guest", 0] == pytest.approx([3.01] * 3)
    # nobody made such a mesh in this run: no time is not a time of zero
    assert [paid_times(r) for r in meshes_charged(guest)] == [[]] * 3
    # a phase that was timed once hides no repetition of the others
    record = ladder("one", 0.4, 0.01, spread=0.5, conforming=True)[0]
    once = replace(record, timings={**record.timings, "meshing": [2.0]})
    assert paid_times(once) == pytest.approx([2.005, 2.01, 2.015])


def test_the_pareto_front_has_only_what_nothing_beats():
    """A later solve with an equal error is not beaten: errors decide that can be told apart."""
    points = work_points(
        [*ladder("good", 0.4, 0.01), *ladder("bad", 0.8, 0.02), solve("best", 0, 0.01, 1.0),
         solve("late", 0, 0.01, 2.0)],
        "energy_norm",
    )  # fmt: skip
    front = [(p.solver, p.level) for p in pareto_front(points)]
    assert front == [("good", 0), ("good", 1), ("good", 2), ("best", 0), ("late", 0)]


def test_the_cut_grows_by_equal_lengths_to_the_whole():
    scene = load_scene(STRIP)
    scenes = growing_scenes(scene, 4)
    lengths = [
        np.linalg.norm(np.diff(np.array(s.cuts[0].points), axis=0), axis=1).sum() for s in scenes
    ]
    whole = math.dist(*scene.cuts[0].points)
    np.testing.assert_allclose(lengths, whole * np.arange(1, 5) / 4, rtol=1e-14)
    assert scenes[-1].cuts == scene.cuts
    assert len({s.name for s in scenes}) == 4


def made(ratios, family="airy"):
    return [
        Trial(family, 2, 2, "energy_norm", ratio * 1e-3, 1e-3, 1e-9, scene=k)
        for k, ratio in enumerate(ratios)
    ]


@pytest.mark.parametrize(
    ("ratios", "coverage", "width"),
    [
        ([2.0] * 100, "PASS", "PASS"),
        # of 100 trials with probability 0.95 at most 91 are hits in 6.3 %, at most 90 in 2.8 %
        ([2.0] * 91 + [0.5] * 9, "PASS", "PASS"),
        ([2.0] * 90 + [0.5] * 10, "FAIL", "PASS"),
        ([20.0] * 100, "PASS", "FAIL"),
        # with 0.85 at most 79 in 6.6 %, at most 78 in 3.9 %
        ([20.0] * 21 + [2.0] * 79, "PASS", "PASS"),
        ([20.0] * 22 + [2.0] * 78, "PASS", "FAIL"),
    ],
)
def test_shares_decide(ratios, coverage, width):
    found = calibration_findings(made(ratios))
    assert [f.verdict for f in found[:2]] == [Verdict(coverage), Verdict(width)]


def test_a_family_that_is_not_covered_fails_beside_many_that_are():
    good = made([2.0] * 600)
    found = calibration_findings([*good, *made([2.0] * 50 + [0.5] * 10, "ring")])
    assert {f.verdict for f in found} == {Verdict.PASS}
    found = calibration_findings([*good, *made([2.0] * 49 + [0.5] * 11, "ring")])
    assert [f.verdict for f in found if "ring" in f.topic] == [Verdict.FAIL]
    assert found[0].verdict is Verdict.PASS


@pytest.mark.parametrize(("n", "hits", "share"), [(100, 91, 0.95), (60, 50, 0.9), (7, 0, 0.5)])
def test_independent_triples_are_judged_by_the_binomial_distribution(n, hits, share):
    tail = binomial_tail([True] * hits + [False] * (n - hits), range(n), share)
    assert tail == pytest.approx(binom.cdf(hits, n, share), rel=1e-12)


def test_triples_of_one_scene_that_agree_count_once():
    hits = [True] * 36 + [False] * 4
    scenes = range(40)
    single, tenfold = (
        binomial_tail([h for h in hits for _ in range(n)], [s for s in scenes for _ in range(n)], p)
        for n, p in ((1, 0.95), (10, 0.95))
    )
    assert tenfold == pytest.approx(single, rel=1e-9)
    independent = binomial_tail([h for h in hits for _ in range(10)], range(400), 0.95)
    assert independent < 1e-3 < 0.05 < tenfold


@pytest.mark.parametrize("family", series_families(quick=False), ids=lambda one: one.name)
def test_series_are_of_the_exponents_that_are_named_and_know_their_limit(family):
    values = family.values(0) - 1.0
    assert values.shape == (400, 3)
    basis = np.power.outer([0.2, 0.1, 0.05], family.exponents)
    coefficients = np.linalg.solve(basis, values.T)
    assert (np.abs(coefficients) > 0.1 * (1 - 1e-9)).all()
    assert (np.abs(coefficients) < 10 * (1 + 1e-9)).all()
    assert np.abs(np.mean(np.sign(coefficients))) < 4 / np.sqrt(1200)
    assert (family.values(0) == values + 1.0).all()
    assert not (family.values(27) == values + 1.0).any()


def test_half_widths_cover_series_of_mixed_orders():
    """Oberkampf and Roy's rule covers 93 %, the window from half to twice the order 74 %."""
    found = [one for family in series_families(quick=False) for one in family.trials(27)]
    findings = calibration_findings(found)
    assert [f.verdict for f in findings] == [Verdict.PASS] * (2 + 4)


@pytest.mark.parametrize("run", [0.9, 2.2, 3.5])
def test_waves_in_bars_are_those_of_central_differences_at_the_critical_step(run):
    # at Courant number 1 central differences move a wave without error
    n = 100
    before, now = np.zeros(n + 1), np.zeros(n + 1)
    now[0] = 1.0 / n  # from rest: half of what the load does to the end's half mass
    for _ in range(round(run * n) - 1):
        after = np.zeros(n + 1)
        after[1:-1] = now[2:] + now[:-2] - before[1:-1]
        after[0] = 2 * now[1] - before[0] + 2.0 / n
        before, now = now, after
    exact, _, _ = wave(np.linspace(0, 1, n + 1), 1.0, run)
    assert now == pytest.approx(exact, abs=1e-12)
    strain = np.diff(now) * n
    assert np.sum(strain**2) / n == pytest.approx(stretched(1.0, run), abs=4 / n)
    assert np.sum((1 + strain) ** 2) / n == pytest.approx(released(1.0, run), abs=4 / n)


def test_every_scene_of_every_family_is_valid_and_one_of_its_own():
    for family in families(quick=False):
        assert family.scenes >= 15
        scenes = [family.scene(index, 0)[0] for index in range(family.scenes)]
        assert len({scene.model_dump_json() for scene in scenes}) == len(scenes)
        for scene in scenes:
            assert not scene.judged_by_exact
            assert any(load.kind == "body_force" for load in scene.loads) == (
                "smooth" in family.name
            )
    again = family.scene(3, 0)[0].model_dump_json()
    assert again == scenes[3].model_dump_json()  # the seed is kept


def test_the_truth_s_own_uncertainty_is_granted():
    granted = [Trial("a", 1, 2, "u", stated=1.0, true=1.05, known=k).covered for k in (0.06, 0.04)]
    assert granted == [True, False]


def family_of(name):
    return next(family for family in families(True) if family.name == name)


@pytest.mark.fenicsx
def test_a_field_that_is_not_in_equilibrium_is_not_covered():
    family = family_of("smooth")

    def without_its_body_force(random):
        return {**family.make(random), "loads": []}

    found = {t.quantity: t for t in trials(replace(family, make=without_its_body_force), 1, 0)}
    for name in ("displacement_l2", "energy_norm", "strain_energy"):
        assert not found[name].covered
        assert found[name].ratio < 0.5


@pytest.mark.fenicsx
def test_bars_of_a_curved_cut_cover_what_its_facets_are_off():
    # P2: the elements would be of order 3 and 4; five of these were not covered
    found = trials(family_of("ring and disc"), 1, 0)
    assert found[0].degree == 2
    assert sum(t.covered for t in found) >= len(found) - 1
    for name in ("displacement_l2", "energy_norm", "jump_l2"):
        (one,) = (t for t in found if t.quantity == name)
        assert one.true <= one.stated < 10 * one.true


@pytest.mark.parametrize("words", [
    ["thesis", "--quick"],
    ["iterations", "dynamics/block_falls_apart", "--solver", "xfem", "--truth", "conforming",
     "--names", "scheme", "mass"],
])  # fmt: skip
def test_ctrl_c_ends_a_study_in_one_line(words, tmp_path, monkeypatch, capsys):
    def stopped(*_, **given):
        raise RunStoppedError(signal.SIGINT)

    for way in ("run_cases", "made"):  # by a run, and by parts
        monkeypatch.setattr(study, way, stopped)
    assert main(["study", *words, "--out", str(tmp_path)]) == 130
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == "verify: error: interrupted by SIGINT; the same command resumes it"

"""Claims about the calibration study: it tells a good error bar from a bad one."""

import re
from dataclasses import replace

import pytest

from verify.report.study_page import render_study
from verify.result import Verdict
from verify.study.calibration.families import families
from verify.study.calibration.study import CalibrationStudy, calibration_findings
from verify.study.calibration.trial import Trial, trials
from verify.study.record import write_study


def made(ratios):
    return [
        Trial("airy", 2, 2 + k, "energy_norm", ratio * 1e-3, 1e-3, 1e-9)
        for k, ratio in enumerate(ratios)
    ]


@pytest.mark.parametrize(
    ("ratios", "coverage", "width"),
    [
        ([2.0] * 20, "PASS", "PASS"),
        ([2.0] * 19 + [0.5], "PASS", "PASS"),
        ([2.0] * 18 + [0.5] * 2, "FAIL", "PASS"),
        ([20.0] * 20, "PASS", "FAIL"),
        ([20.0] * 4 + [2.0] * 16, "PASS", "PASS"),
    ],
)
def test_shares_decide(ratios, coverage, width):
    found = calibration_findings(made(ratios))
    assert [f.verdict for f in found] == [Verdict(coverage), Verdict(width)]


def test_what_is_not_known_does_not_count():
    unknown = replace(made([0.001])[0], left_out="round-off")
    assert calibration_findings([*made([2.0]), unknown])[0].verdict is Verdict.PASS
    assert calibration_findings([unknown])[0].verdict is Verdict.UNDECIDED


def test_families_that_nothing_was_tuned_on_are_told_apart():
    held = [replace(one, held_out=True) for one in made([20.0] * 3)]
    covered, width = calibration_findings([*made([2.0] * 17), *held])
    assert "nothing was tuned on, 3 of 3" in covered.sentence
    assert "nothing was tuned on, 0 of 3" in width.sentence


def test_the_truth_s_own_uncertainty_is_granted():
    assert Trial("a", 1, 2, "u", stated=1.0, true=1.05, known=0.06).covered
    assert not Trial("a", 1, 2, "u", stated=1.0, true=1.05, known=0.04).covered


def test_every_family_is_a_valid_scene_in_equilibrium_by_its_loads():
    for family in families(quick=False):
        scene = family.scene()
        assert not scene.judged_by_exact
        assert bool(scene.loads) == ("smooth" in family.name)


@pytest.mark.fenicsx
def test_a_field_that_is_not_in_equilibrium_is_not_covered():
    (family,) = [f for f in families(True) if (f.name, f.degree) == ("smooth", 2)]
    content = {key: value for key, value in family.content.items() if key != "loads"}
    found = {t.quantity: t for t in trials(replace(family, levels=3, content=content))}
    for name in ("displacement_l2", "energy_norm", "strain_energy"):
        assert not found[name].covered
        assert found[name].ratio < 0.5


@pytest.mark.fenicsx
def test_norms_of_a_smooth_field_are_covered_and_drawn(tmp_path):
    (family,) = [f for f in families(True) if (f.name, f.degree) == ("airy", 1)]
    found = trials(replace(family, levels=3, size=1 / 3))
    norms = [t for t in found if t.quantity in ("displacement_l2", "energy_norm", "jump_l2")]
    assert len(norms) == 3
    for one in norms:
        assert not one.left_out
        assert one.true <= one.stated < 10 * one.true
    study = CalibrationStudy(found, calibration_findings(found), True, 1.0)
    write_study(tmp_path, "calibration", study.as_record(), study.rows(), "by hand")
    page = render_study(tmp_path, "calibration").read_text(encoding="utf-8")
    assert page.count('class="marker"') == sum(t.true > 0 and not t.left_out for t in found)
    assert "relative energy-norm error, level 2: stated" in page


def test_every_family_has_a_mark_of_its_own_in_the_figure(tmp_path):
    found = [
        replace(made([2.0])[0], family=one.name, degree=one.degree, held_out=one.held_out)
        for one in families(quick=False)
    ]
    study = CalibrationStudy(found, calibration_findings(found), False, 1.0)
    write_study(tmp_path, "calibration", study.as_record(), study.rows(), "by hand")
    page = render_study(tmp_path, "calibration").read_text(encoding="utf-8")
    drawn = set(re.findall(r'<(circle|rect)(?=[^>]*class="marker")[^>]*stroke="([^"]*)"', page))
    assert len(drawn) == len({one.name for one in families(quick=False)})
    assert ("rect" in page) == any(one.held_out for one in found)

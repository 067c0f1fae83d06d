"""Numbers and rankings: digits that tell ends apart, marks beside ranks, pages of studies."""

import json
from dataclasses import replace

import numpy as np
import pytest
from page_parser import parsed
from synthetic_run import make_run
from synthetic_studies import HOSTILE, STUDIES, make_studies

from verify.cli import ranking as runner_ranking
from verify.cli.ranking import rank_run
from verify.conformance import CheckResult, State
from verify.report import plots as figures
from verify.report.notation import error_text, number, scientific, with_interval
from verify.report.plots import Palette
from verify.report.rendering import render
from verify.report.run_directory import load_run
from verify.report.study_page import render_study
from verify.report.tables import check_row
from verify.result import Status, Verdict, VerdictRecord


@pytest.mark.parametrize(
    ("value", "half", "written"),
    [
        (7.3651e-4, 1e-7, "7.365×10⁻⁴ [7.364×10⁻⁴, 7.366×10⁻⁴]"),
        (1.0017, 2e-5, "1.00170 [1.00168, 1.00172]"),
        (1.0443504632, 4e-11, "1.044 ± 4×10⁻¹¹"),
        (1.0, 0.0, "1.000"),
    ],
)
def test_an_interval_is_written_with_the_digits_that_tell_its_ends_apart(value, half, written):
    assert with_interval(value, value - half, value + half) == written


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.9996, "1.00"),
        (0.997, "0.997"),
        (-0.09996, "−0.100"),
        (99999.6, "1.00×10⁵"),
        (1e4, "10000"),
    ],
)
def test_a_number_that_is_rounded_up_to_a_power_of_ten_has_no_digit_more(value, written):
    assert number(value, 3) == written


@pytest.mark.parametrize(
    ("error", "uncertainty", "written"),
    [
        (2e-3, 5e-3, "not resolved (< 0.0070)"),
        (0.0, 1.01e-3, "not resolved (< 0.0011)"),  # the bound is rounded up
        (0.0, 9.91e-2, "not resolved (< 0.10)"),
        (6e-3, 5e-3, "0.0060 ± 0.0050"),
        (0.0, 0.0, "0"),
        (float("nan"), 1e-3, number(float("nan"))),
    ],
)
def test_an_error_that_is_not_above_its_uncertainty_is_no_number(error, uncertainty, written):
    assert error_text(error, uncertainty) == written


def test_a_value_is_written_with_the_digits_of_the_one_it_shall_have():
    """8.079 beside 8.078757937 ± 1e-05 would look like a failure."""
    found = VerdictRecord(
        "value", "reference", "strain_energy", Verdict.PASS, 8.0787592969, 8.0787592969,
        8.0787592969, "8.078757937 ± 1e-05 (relative)", "",
    )  # fmt: skip
    assert check_row(found)[1] == "8.078759"


def test_a_value_and_its_limit_have_their_unit_and_powers_of_ten_are_written_alike():
    found = VerdictRecord(
        "value", "xfem", "mass_below", Verdict.FAIL, -24.4972870, -24.4972870, -24.4972870,
        "-24.5 ± 1e-07 (relative)", "off by 1.11e-04 (relative)",
    )  # fmt: skip
    _, observed, limit, verdict = check_row(found, "N s/m")
    assert observed == "−24.4973 N s/m"  # what it is off by can be seen, and no more
    assert limit == "-24.5 N s/m ± 10⁻⁷ (relative)"
    assert verdict.note == "off by 1.11×10⁻⁴ (relative)"
    assert scientific("plane[epsilon=1e-12] of 2.50e+03") == "plane[epsilon=1e-12] of 2500"


def ranked(root, conformance=False):
    return rank_run(root, load_run(root).results, {}, conformance, 10.0, lambda text: None)


def text_of(root):
    return parsed(render(root).read_text(encoding="utf-8")).text


@pytest.fixture
def suite(monkeypatch):
    """Replace the suite by one that says that XFEM breaks something; count how often it runs."""
    asked = []

    def conform(solver, parameters, timeout):
        asked.append((solver, dict(parameters)))
        state = State.FAIL if solver == "xfem" else State.PASS
        return [
            CheckResult("traction", "two halves contract each for itself", state, 1.0, 0.1, "off"),
            CheckResult("refusals", "it does not crash", State.PASS),
        ]

    monkeypatch.setattr("verify.conformance.conform", conform)
    return asked


def test_a_run_of_several_solvers_says_which_and_a_run_without_ranking_does_not(
    tmp_path, plain_run
):
    root = make_run(tmp_path / "run", pictures=False)
    assert "solvers on" not in (plain_run / "report.html").read_text(encoding="utf-8")
    ranked(root)
    said = text_of(root)
    assert "solvers on 3 scenes at rest, compared two by two" in said
    assert "conformance" in said
    stored = json.loads((root / "results.json").read_text())["ranking"]
    assert stored == json.loads((root / "ranking.json").read_text())


def test_conformance_is_taken_over_until_the_solver_changes(tmp_path, suite, monkeypatch):
    root = make_run(tmp_path / "run", False, "griffith_inside")
    ranked(root, conformance=True)
    assert "two halves contract each for itself" in text_of(root)
    first = list(suite)
    # 'other' is no solver that could be asked
    assert [name for name, _ in first] == ["xfem", "conforming"]
    ranked(root, conformance=False)
    assert suite == first
    assert "checks" in json.loads((root / "ranking.json").read_text())["conformance"]["xfem"]
    monkeypatch.setattr(runner_ranking, "code_of_solver", lambda name: "changed")
    ranked(root, conformance=True)
    assert len(suite) == 2 * len(first)


def test_a_solver_that_solved_nothing_is_not_asked_for_more(tmp_path, suite):
    root = make_run(tmp_path / "run", pictures=False)
    results = load_run(root).results
    for result in results:
        ended = [s if s.solver != "conforming" else replace(s, status=Status.FAILED)
                 for s in result.solves]  # fmt: skip
        result.solves[:] = ended
    rank_run(root, results, {}, True, 10.0, lambda text: None)
    assert [name for name, _ in suite] == ["xfem"]


@pytest.mark.parametrize("kind", STUDIES)
def test_page_and_markdown_say_the_same_and_no_text_of_a_record_becomes_markup(studies, kind):
    text = render_study(studies, kind).read_text(encoding="utf-8")
    page = parsed(text)
    assert HOSTILE in page.text
    assert "alert(1)</script>" not in text
    markdown = render_study(studies, kind, "markdown").read_text(encoding="utf-8")
    assert "a\\|b &lt;script&gt;alert(1)&lt;/script&gt; \\`x\\` \\*y\\*" in markdown
    for said in ("1 finding: 0 passed, 1 failed, 0 undecided.", "Seen: 2 of 3."):
        assert said in page.text
        assert said in markdown
    assert markdown.count("![") == len(page.all("svg"))
    assert all((studies / name).is_file() for name in pictures(markdown))


def pictures(markdown):
    return [part.split(")")[0] for part in markdown.split("](")[1:]]


def test_numbers_of_studies_are_those_of_the_record(studies):
    texts = {k: render_study(studies, k).read_text(encoding="utf-8") for k in STUDIES}
    for kind, said in (
        ("slivers", "0.899 at 0.1"), ("slivers", "∝ ε^0.00"),
        ("energy", "XFEM scheme=x"), ("energy", "2.50×10⁻¹³"),
        ("cost", "500\N{NO-BREAK SPACE}ms (400–600)"), ("cost", "not reached"),
        ("budget", "−2.03 %"), ("budget", "round-off"), ("budget", "it ran away"),
        ("thesis", "within 1 ms 25.0 % (0.0 % in wall time), within 2 ms 50.0 % (12.5 % in wall"),
        ("thesis", "0.28435\N{NO-BREAK SPACE}s"), ("thesis", "10.4\N{NO-BREAK SPACE}mm/s"),
        ("calibration", "2.00"), ("calibration", "1 marks, 0 not covered"),
    ):  # fmt: skip
        assert said in texts[kind], (kind, said)


def test_numbers_keep_their_units_and_commands_their_signs(tmp_path):
    """On the site `--solver` and straight quotes stay as they are in code alone."""
    command = "verify study energy --solver 'xfem tip=inside' -k '[a|b] > 1'"
    record = json.loads((make_studies(tmp_path) / "cost.json").read_text())
    (tmp_path / "cost.json").write_text(json.dumps({**record, "command": command}))
    text = render_study(tmp_path, "cost", "markdown").read_text(encoding="utf-8")
    assert text.count("--solver") == text.count(f"`{command}`") == 2
    for joined in ("2.5\N{NO-BREAK SPACE}ms", "1\N{NARROW NO-BREAK SPACE}200"):
        assert joined in text
    page = parsed(render_study(tmp_path, "cost").read_text(encoding="utf-8"))
    assert len(page.all("code")) == 2


def test_a_place_that_is_not_known_is_a_gap_of_the_curve_and_not_bridged(monkeypatch):
    kept = []

    def keep(figure, alt):
        kept.extend(line.get_xydata() for line in figure.axes[0].lines)
        return alt

    monkeypatch.setattr(figures, "drawing", keep)
    places = [(0.25, 0.1), (None, 0.01), (4.0, 0.0), (8.0, 1e-3), (16.0, 1e-4)]
    said = figures.loglog("error", "time", [figures.Series("strain energy", places)], Palette())
    (curve,) = kept
    assert np.isfinite(curve).all(axis=1).tolist() == [True, False, False, True, True]
    assert curve[3:] == pytest.approx(np.array([(8.0, 1e-3), (16.0, 1e-4)]))
    assert "strain energy: 0.1 at 0.25, 0.001 at 8, 0.0001 at 16." in said

"""Claims about the section that ranks solvers, and about the conformance asked before it."""

import json
import re
from dataclasses import replace

import pytest
from page_parser import parsed
from synthetic_run import make_run

from verify.cli import run_ranking as runner_ranking
from verify.cli.run_ranking import rank_run
from verify.conformance import CheckResult, State
from verify.report import load_run, render
from verify.result import Status


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


def test_a_run_of_several_solvers_says_which_and_a_run_without_ranking_does_not(tmp_path):
    root = make_run(tmp_path / "run", pictures=False)
    assert "solvers on" not in text_of(root)
    ranked(root)
    said = text_of(root)
    assert "solvers on 3 cases" in said
    assert "conformance" in said
    stored = json.loads((root / "results.json").read_text())["ranking"]
    assert stored == json.loads((root / "ranking.json").read_text())


def test_a_solver_that_does_not_conform_carries_a_mark_wherever_it_is_ranked(tmp_path, suite):
    root = make_run(tmp_path / "run", pictures=False)
    ranked(root, conformance=True)
    page = parsed(render(root).read_text(encoding="utf-8"))
    assert "two halves contract each for itself" in page.text
    marks = page.all("abbr")
    assert len(marks) >= 2
    assert re.search(r"XFEM\s*†", page.text)
    assert not re.search(r"conforming P1\s*†", page.text)


def test_conformance_is_taken_over_until_the_solver_changes(tmp_path, suite, monkeypatch):
    root = make_run(tmp_path / "run", pictures=False)
    ranked(root, conformance=True)
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

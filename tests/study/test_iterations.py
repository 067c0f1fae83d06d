"""The study of iterations against error, by a solver whose errors are known."""

import csv
import io
import sys
import textwrap
from contextlib import redirect_stdout

import pytest
from command_line import forking

from verify.cli import main
from verify.scene import load_scene
from verify.study.study import Making

# nodes of the field u = t (1 + 2^-iterations + 0.01 / substeps) x; solved: without the middle part
SOLVER = """
import numpy as np
from verify.exchange import problem_of
from verify.solution import Solution

class Halving:
    name = "halving"
    parameters = {"iterations": 1, "substeps": 1, "step": "descent"}
    def refuses(self, scene): return None
    def levels(self, scene): return 1
    def solve(self, scene, level, repetitions=1, iterations=1, substeps=1, step="descent"):
        if iterations == 7:
            raise RuntimeError("seven is too many")
        if step == "solved" and scene.name == "dynamics/freed_half":
            raise RuntimeError("does not converge")
        problem, times = problem_of(scene, level), np.array(scene.analysis.output_times)
        late = 0.0 if step == "solved" else 0.5**iterations
        u = 1e-3 * times[:, None, None] * (1.0 + late + 0.01 / substeps) * problem.points
        v = np.gradient(u, times, axis=0)
        order = slice(None, None, -1 if step == "solved" and "two_cuts" in scene.name else 1)
        number = np.arange(len(problem.points))[order]
        return Solution(problem.points[order], number[problem.cells], u[:, order], times,
                        velocity=v[:, order], unknowns=u[0].size, size=problem.size,
                        timings={"motion": [iterations * substeps * 1.0]})
"""


CASES = ("dynamics/block_falls_apart", "dynamics/prestrained_bar")  # exact, the second
UNSOLVED = "dynamics/freed_half"
RENUMBERED = "dynamics/two_cuts_in_turn"  # by the solved steps alone


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The rows of its table, its output, and its folder."""
    folder, said = tmp_path_factory.mktemp("halving"), io.StringIO()
    (folder / "halving.py").write_text(textwrap.dedent(SOLVER))
    words = ["study", "iterations", *CASES, UNSOLVED, RENUMBERED, "--solver", "halving:Halving"]
    words += ["--substeps", "1", "2", "--most", "9", "--tolerance", "0.02", "--out", "studies"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(folder)
        with redirect_stdout(said), forking("halving:Halving".__eq__):
            assert main([*words, "--iterations", "4", "7", "--work", "8"]) == 0
    sys.modules.pop("halving")
    with open(folder / "studies" / "iterations.csv", newline="") as file:
        return list(csv.DictReader(file)), said.getvalue(), folder / "studies"


def test_both_errors_are_those_of_the_solver(found):
    rows = {(row["case"], row["iterations"], row["substeps"]): row for row in found[0]}
    assert len(rows) == 14
    assert "quantities" not in found[0][0]  # each is a column
    counts = {
        key[1:] for key in rows if key[1]
    }  # eight in a step: 8 once, 4 twice; 7 twice is more
    assert counts == {("4", "1"), ("7", "1"), ("8", "1"), ("4", "2")}
    for (case, count, parts), row in rows.items():
        if count == "7":
            assert "seven" in row["reason"]
            continue
        late = 0.5 ** int(count) if count else 0.0
        assert float(row["iteration_error"]) == pytest.approx(late / 1.00125, abs=1e-12)
        whole = abs(late + 0.01 / int(parts) - 0.00125) / 1.00125
        assert float(row["whole_error"]) == pytest.approx(whole, abs=1e-12)
        step = load_scene(case).analysis.time_step
        assert float(row["time_step"]) == pytest.approx(step / int(parts))


def test_a_case_without_its_truth_takes_no_other_along(found):
    assert UNSOLVED not in {row["case"] for row in found[0]}
    said = " ".join(found[1].split())
    assert f"{UNSOLVED}, halving:Halving" in said
    assert "has no answer: RuntimeError: does not converge" in said


def test_nodes_in_another_order_are_not_compared_one_by_one(found):
    assert RENUMBERED not in {row["case"] for row in found[0]}
    assert "nodes; the solver has others" in " ".join(found[1].split())


def test_the_findings_say_from_which_setting_on(found):
    out = found[1]
    assert "From 8 iterations on" in out
    assert "No number of iterations up to 4" in out
    assert out.count("Without an answer: 7.") == 2
    assert out.count("is 8 iterations in a step of the case: 8 in each of 1") == 2


def test_the_error_over_substeps_is_told_by_equal_work_and_by_equal_iterations(found):
    """2⁻⁸ + 0.00875, 2⁻⁴ + 0.00375 at a work of 8; 2⁻⁴ + the same at 4 in each; over 1.00125."""
    out = " ".join(found[1].split())
    said = "Over substeps the whole error is"
    assert out.count(f"{said} 1.26 % with 1, 6.62 % with 2: least with 1.") == 2
    assert out.count(f"{said} 7.12 % with 1, 6.62 % with 2: least with 2.") == 2
    page = (found[2] / "iterations.html").read_text()
    assert "8 in a step: 0.0126 at 1, 0.0662 at 2." in page
    assert "4 in each: 0.0712 at 1, 0.0662 at 2." in page


def test_the_page_answers_in_work_and_not_in_time(found):
    """At 8 iterations in a step: 2⁻⁸ + 0.00875 without substeps, 2⁻⁴ + 0.00375 with two."""
    text = " ".join((found[2] / "iterations.html").read_text().split())
    met = ", ".join(f"8 ({case})" for case in CASES)
    assert f"within 2 % of the same steps, solved to convergence: {met}." in text
    assert "Substeps do not pay at equal work on any of 2 cases" in text
    assert f"{CASES[0]}, 8 iterations: 0.066 with 2 substeps, 0.013 with 1" in text


def test_every_setting_is_a_solve_that_is_kept_until_another_question_is_asked(found):
    (run,) = found[2].glob("iterations-*/run.json")
    solves = [path.parent.name for path in run.parent.glob("cases/*/*/record.json")]
    # of each case 4, 7, 8 with one substep, 4 with two; 1, 2, 8 solved
    assert len(solves) == 4 * 7
    place = Making(found[2]).place_of("iterations", "another question")
    assert not run.exists()
    assert place.startswith("iterations-")

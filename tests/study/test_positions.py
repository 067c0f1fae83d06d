"""The study of positions: ratios by hand, and solvers whose errors on each mesh are known."""

import csv
import sys
import textwrap
from dataclasses import asdict

import numpy as np
import pytest
from command_line import forking

from verify.cli import main
from verify.judge.models import coarsest
from verify.report.study_page import positions_lead, positions_view, render_study
from verify.result import CaseResult, Metric, ReferenceRecord, SolveRecord, Status
from verify.runner.fingerprint import physics_digest
from verify.scene import load_scene
from verify.study.positions import SCENES, _at, spread_of, summary
from verify.study.study import write_study


def result_of(scene, errors, failed=()):
    """A case with the relative errors of some solvers, ± their half-widths."""
    solves = [
        SolveRecord(
            scene, solver, 0, Status.SOLVED, size=0.1,
            metrics=[Metric(name, value, "1", None, width, "exact")
                     for name in ("displacement_l2", "energy_norm")],
        )
        for solver, (value, width) in errors.items()
    ]  # fmt: skip
    solves += [SolveRecord(scene, name, 0, Status.FAILED, reason="it broke") for name in failed]
    return CaseResult(scene, scene, "", "", {}, ReferenceRecord(), solves, [], [])


def study_of(table, solvers=("mine", "conforming")):
    """Of {scene: [errors of `solvers` on each position]}."""
    found = {
        (scene, number): result_of(
            scene, {s: (e, 0.0) for s, e in zip(solvers, errors, strict=True) if e is not None},
            [s for s, e in zip(solvers, errors, strict=True) if e is None],
        )
        for scene, rows in table.items()
        for number, errors in enumerate(rows)
    }  # fmt: skip
    return summary(found, dict.fromkeys(table, 0), solvers)


def lead_of(study):
    return positions_lead(asdict(study))


def pair(study, scene, solver, rival, metric="displacement_l2"):
    asked = {"scene": scene, "solver": solver, "rival": rival, "metric": metric}
    (found,) = [p for p in study.pairs if asked.items() <= p.items()]
    return found


def test_median_and_range_by_hand():
    # 0 … 20 twentieths: the 5th percentile is the second smallest of 21
    ratios = np.random.default_rng(3).permutation(np.arange(21.0))
    assert spread_of(ratios) == {"ratio": 10.0, "low": 1.0, "high": 19.0, "differs": False}
    # between the two smallest of five, a fifth of the way
    assert spread_of([8.0, 2.0, 4.0, 3.0, 16.0]) == pytest.approx(
        {"ratio": 4.0, "low": 2.2, "high": 14.4, "differs": True}
    )
    assert spread_of([0.5, 0.6, 0.7])["differs"]
    assert not spread_of([0.5, 0.6, 1.7])["differs"]


def test_scenes_are_joined_ratio_by_ratio_and_not_mean_by_mean():
    """Ratios 1/2 thrice and 3 once: the median of all is 1/2, of the two medians 7/4."""
    study = study_of({"a": [(1.0, 2.0), (2.0, 4.0), (3.0, 6.0)], "b": [(0.3, 0.1)]})
    whole = pair(study, "all", "mine", "conforming")
    assert (whole["ratio"], whole["count"], whole["scenes"]) == (0.5, 4, 2)
    assert pair(study, "b", "mine", "conforming")["ratio"] == pytest.approx(3.0)
    assert pair(study, "all", "conforming", "mine")["ratio"] == pytest.approx(2.0)
    assert pair(study, "all", "mine", "conforming", "energy_norm")["ratio"] == 0.5


def test_a_mesh_on_which_either_is_exact_failed_or_unknown_has_no_ratio():
    rows = [(0.2, 0.1), (1e-15, 0.1), (None, 0.1), (0.4, 0.1), (0.6, 0.1)]
    study = study_of({"a": rows})
    found = pair(study, "all", "mine", "conforming")
    assert (found["count"], found["ratio"]) == (3, pytest.approx(4.0))
    (lost,) = study.missing
    assert (lost["scene"], lost["solver"], lost["positions"]) == ("a", "mine", 2)
    unknown = {("a", 0): result_of("a", {"mine": (0.1, 0.2), "conforming": (0.1, 0.0)})}
    study = summary(unknown, {"a": 0}, ["mine", "conforming"])
    assert not study.pairs
    assert "cannot tell it from zero" in study.missing[0]["reason"]


def test_a_difference_is_said_only_where_the_range_excludes_1():
    above = [(1.1 + 0.01 * k, 1.0) for k in range(16)]
    study = study_of(dict.fromkeys("abcdef", above))
    counts, against = lead_of(study).sentences
    assert "1 of 1 differ in the error of the displacement" in counts
    assert "these differ: mine 1.1" in against
    assert "Nothing is claimed" not in counts
    both = {**dict.fromkeys("abcde", above), "f": [(0.9, 1.0)] * 16}
    assert "these are not told apart: mine" in lead_of(study_of(both)).sentences[1]
    assert "not told apart" in study_of(both).findings[0].sentence
    assert "Nothing is claimed" in lead_of(study_of({"a": above})).sentences[0]
    barely = study_of(dict.fromkeys("abcdef", [(1.0003, 1.0)] * 16))
    assert "differ: mine 1 (1.0003 to 1.0003)" in lead_of(barely).sentences[1]


def test_a_page_counts_the_meshes_won_and_shows_the_worst_by_hand():
    """Plane: 1/2, 3/4 and 2 of the measure; in space one mesh, whose error is round-off."""
    study = study_of({"a": [(1.0, 2.0), (3.0, 4.0), (8.0, 4.0)], "b": [(1e-16, 0.1)]})
    record = asdict(study) | {"dimensions": {"a": 2, "b": 3}}
    won, errors = positions_view(record)["tables"][-2:]
    texts = [[[cell.text for cell in row] for row in table.rows] for table in (won, errors)]
    assert texts[0] == [["mine", "2 of 3", "2.00", "–", "–"]]
    assert ["mine", "3.0, 7.5, 8.0", "1.0×10⁻¹⁶, 1.0×10⁻¹⁶, 1.0×10⁻¹⁶"] in texts[1]


def test_what_is_not_told_apart_over_all_scenes_is_where_single_ones_tell_it():
    study = study_of({"a": [(2.0, 1.0), (3.0, 1.0)], "b": [(1.0, 2.0), (1.0, 3.0)]})
    assert "mine 1.25 (0.358 to 2.85), apart in 2 of 2 scenes" in " ".join(lead_of(study).sentences)


def test_a_page_says_once_what_its_scenes_levels_and_limit_are(tmp_path):
    """Of two pages of positions each has its own title and heads; of equal heads none is short."""

    def page(name, *scenes):
        write_study(tmp_path / name, "positions", study_of({s: [(2.0, 1.0)] for s in scenes}), "c")
        return render_study(tmp_path / name, "positions", "markdown").read_text("utf-8")

    own = page("own", "benchmark/c2_meeting", "benchmark/c5_blade_03")
    mixed = page("mixed", "benchmark/c1_slit", "statics/f3_inclined")
    same = page("same", "benchmark/c5_blade_01", "benchmark/c5_blade_03")
    first = [text.splitlines()[0] for text in (own, mixed)]
    assert first[0].endswith("in the benchmark's scenes?")
    assert first[1].endswith("in 2 scenes of 2 kinds?")
    assert "| solver | all | C2 | C5 |" in own
    assert own.count("level 0: C2 (benchmark/c2_meeting), C5 (benchmark/c5_blade_03)") == 1
    assert "| solver | all | C1 | f3_inclined |" in mixed
    assert "| solver | all | benchmark/c5_blade_01 | benchmark/c5_blade_03 |" in same
    assert own.count("differ where the range excludes 1") == 1
    html = render_study(tmp_path / "own", "positions").read_text("utf-8")
    assert 'class="verdicts free"' in html  # on a phone its third column is called no limit


# off by 0.01 (1 + position)^power in every norm; on the third mesh it breaks if asked
SOLVER = """
from verify.solvers import find_solver
from dataclasses import replace

class Scaled:
    name = "scaled"
    parameters = {"power": 1, "breaks": False}
    def refuses(self, scene): return None
    def levels(self, scene): return scene.mesh.count
    def solve(self, scene, level, repetitions=1, power=1, breaks=False):
        if breaks and scene.mesh.position == 2:
            raise RuntimeError("three is too many")
        found = find_solver("xfem").solve(scene, level, repetitions)
        more = 1.0 + 0.01 * (1 + scene.mesh.position) ** power
        return replace(found, displacement=more * found.displacement)
"""


def test_errors_on_each_mesh_are_those_of_the_solver(tmp_path, monkeypatch, capsys):
    """The patch is exact on every position, so that an answer k times too large is off by k − 1."""
    (tmp_path / "scaled.py").write_text(textwrap.dedent(SOLVER))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    names = ["scaled:Scaled power=0", "scaled:Scaled power=1 breaks=true"]
    words = ["study", "positions", "statics/f1_patch", "--positions", "4", "--out", "studies"]
    words += [word for name in names for word in ("--solver", name)]
    with forking("scaled:Scaled".__eq__):
        assert main(words) == 0
    said, kept = capsys.readouterr(), tmp_path / "studies"
    with open(kept / "positions.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * (4 + 3)
    for row in rows:
        off = 0.01 * (1.0 + int(row["position"])) ** ("power=1" in row["solver"])
        assert float(row["value"]) == pytest.approx(off, rel=1e-8)
    with open(kept / "pairs.csv", newline="") as file:
        pairs = list(csv.DictReader(file))
    (found,) = [
        p for p in pairs
        if p["scene"] == "all" and p["metric"] == "energy_norm" and "power=1" in p["solver"]
    ]  # fmt: skip
    # ratios 1, 2, 4
    assert float(found["ratio"]) == pytest.approx(2.0, rel=1e-8)
    assert float(found["low"]) == pytest.approx(1.1, rel=1e-8)
    assert float(found["high"]) == pytest.approx(3.8, rel=1e-8)
    page = (kept / "positions.html").read_text(encoding="utf-8")
    assert page.index("Which solvers differ") < page.index("<svg")
    assert "three is too many" in page
    assert "2 (1.1 to 3.8)" in page  # in the words for the figure
    assert said.out.count("shown:") == 2
    sys.modules.pop("scaled")


@pytest.mark.parametrize(("words", "message"), [
    (["statics/f1_patch", "--positions", "17"], "17; a mesh has 16"),
    (["statics/f1_patch", "--level", "2"], "2: 'statics/f1_patch' has 0..1"),
    (["statics/f1_patch", "--solver", "xfem"], "one solver has no ratio"),
    (["curved/arc_from_a_corner"], "has unstructured meshes"),
])  # fmt: skip
def test_what_has_no_positions_is_refused_before_a_solve(words, message, tmp_path, capsys):
    assert main(["study", "positions", *words, "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_scenes_of_the_study_are_six_at_rest_four_in_the_plane():
    scenes = [load_scene(name) for name in SCENES]
    assert [s.dimension for s in scenes].count(2) == 4
    assert len(scenes) == 6
    for scene in scenes:
        assert scene.analysis.kind == "static"
        assert SCENES[scene.name] < scene.mesh.count
        assert _at(scene, SCENES[scene.name], 15).mesh.position == 15
    # one level on the mesh as asked is the scene, but for quantities beside an exact field
    asked = load_scene("curved/s_shape")
    assert physics_digest(_at(asked, 0, 0)) == physics_digest(coarsest(asked, 1))

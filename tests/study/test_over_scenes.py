"""Studies over families of scenes, by any solver: their commands, records, pages and faults."""

import csv
import json
import re
import shlex
from pathlib import Path

import pytest

from verify.cli import main
from verify.errors import InputError
from verify.report.study_page import render_study
from verify.result import Verdict
from verify.scene import load_scenes
from verify.study.measured_scenes import Measurement, measured_scenes
from verify.study.slivers.findings import findings
from verify.study.variants import variant_of

GUIDE = Path(__file__).parents[2] / "docs" / "guide" / "studies.md"
COMMANDS = re.findall(r"^\$ verify (study (?:slivers|energy) .*)$", GUIDE.read_text(), re.MULTILINE)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Directory in which the commands of the guide have run."""
    place = tmp_path_factory.mktemp("guide")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for command in COMMANDS:
            assert main([*shlex.split(command), "-j", "1"]) == 0
    return place / "studies"


def test_the_guide_has_commands_for_both_studies():
    assert [c.split()[1] for c in COMMANDS] == ["slivers", "energy"]


@pytest.mark.parametrize("kind", ["slivers", "energy"])
def test_record_table_and_page_are_written_and_agree(written, kind):
    record = json.loads((written / f"{kind}.json").read_text(encoding="utf-8"))
    assert (record["schema"], record["kind"]) == (1, f"{kind} study")
    with (written / f"{kind}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(record["measurements"]) > 20
    assert record["findings"]
    page = (written / f"{kind}.html").read_text(encoding="utf-8")
    for finding in record["findings"]:
        assert finding["topic"] in page
    assert ("<svg" in page) == (kind == "slivers")
    # nothing is fetched
    assert not re.search(r"""(?:src|href)=["'](?!#)|url\((?!#)|@import""", page)


def test_a_damaged_record_is_one_line(written, tmp_path):
    with pytest.raises(InputError, match="slivers"):
        render_study(tmp_path, "slivers")


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        ("xfm", "no solver 'xfm'"),
        ("xfem slivers", "expected NAME PARAMETER=VALUE"),
        ("xfem slivers=", "expected NAME PARAMETER=VALUE"),
        ("xfem sliver=keep", "xfem has no parameter 'sliver'; did you mean 'slivers'"),
        ("", "no solver ''"),
    ],
)
def test_a_bad_solver_is_one_line(solver, message):
    with pytest.raises(InputError, match=message):
        variant_of(solver)


@pytest.mark.parametrize("study", ["slivers", "energy"])
def test_cases_that_do_not_suit_a_study_are_one_line(study, tmp_path, capsys):
    case = "statics/f1_patch"
    assert main(["study", study, case, "--solver", "xfem", "--out", str(tmp_path / "s")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "s").exists()


class Broken:
    """Raises, which is a row with its reason."""

    name = "broken"

    def refuses(self, scene):
        return None

    def levels(self, scene):
        return 1

    def solve(self, scene, level, repetitions=1):
        raise ZeroDivisionError("the pivot is zero")


def test_a_solver_that_raises_is_a_row_and_a_failed_finding(monkeypatch):
    from verify.scene import scene_content
    from verify.study import variants
    from verify.study.variants import Variant

    monkeypatch.setattr(variants, "find_solver", lambda name: Broken())
    rows = [scene_content(scene) for scene in load_scenes("slivers/plane_edges_quick")]
    measured = measured_scenes(Variant("broken", "broken"), rows)
    assert [m.size for m in measured] == [0.5, 1e-12, 0.0]
    assert all(m.value is None and "pivot" in m.reason for m in measured)
    (finding,) = findings(measured, [])
    assert finding.verdict is Verdict.FAIL
    assert "No solution at 0.5, 1e-12, 0" in finding.sentence


@pytest.mark.parametrize(
    ("near", "far", "verdicts"),
    [
        (1.04, 1.2, [Verdict.PASS, Verdict.PASS]),
        (1.06, 1.3, [Verdict.FAIL, Verdict.FAIL]),
        (0.94, 0.5, [Verdict.FAIL, Verdict.PASS]),
    ],
)
def test_errors_are_held_against_the_row_at_zero_and_the_conforming_mesh(near, far, verdicts):
    def row(solver, size, value):
        return Measurement("family", size, solver, "displacement_l2", "", value)

    measured = [row("own", 0.5, far), row("own", 1e-6, near), row("own", 0.0, 1.0)]
    measured += [row("conforming", 0.5, 1.0)]
    assert [f.verdict for f in findings(measured, [])] == verdicts

"""Studies over families of scenes, by any solver: their commands, records, pages and faults."""

import csv
import json
import re
import shlex
from pathlib import Path

import pytest

from verify.cli import main
from verify.result import Verdict
from verify.study.measured_scenes import Measurement
from verify.study.slivers.findings import findings

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

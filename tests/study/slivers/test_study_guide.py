"""The commands of the guide run as printed and write what it says; faults get one line."""

import csv
import json
import re
import shlex
from pathlib import Path

import pytest

from verify.cli import main
from verify.errors import InputError
from verify.report.study_page import render_study

GUIDE = Path(__file__).parents[3] / "docs" / "studies.md"
COMMANDS = re.findall(r"^\$ verify (.*)$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Directory in which all commands of the guide have run."""
    place = tmp_path_factory.mktemp("guide")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for command in COMMANDS:
            assert main(shlex.split(command)) == 0
    return place / "studies"


def test_the_guide_has_commands_for_both_studies():
    assert [c.split()[1] for c in COMMANDS] == ["slivers", "energy"]


@pytest.mark.parametrize("kind", ["slivers", "energy"])
def test_record_table_and_page_are_written_and_agree(written, kind):
    record = json.loads((written / f"{kind}.json").read_text(encoding="utf-8"))
    assert record["schema"] == 1
    assert record["kind"] == f"{kind} study"
    assert record["provenance"]["versions"]["numpy"]
    with (written / f"{kind}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 100
    if kind == "slivers":
        assert len(rows) == len(record["measurements"])
    page = (written / f"{kind}.html").read_text(encoding="utf-8")
    for finding in record["findings"]:
        assert finding["topic"] in page
    assert page.count("<svg") >= 6
    # nothing is fetched
    assert not re.search(r"""(?:src|href)=["'](?!#)|url\(|@import""", page)
    assert "nan" not in re.sub(r"[a-z]*nan[a-z]+|[a-z]+nan", "", page)
    assert len(page) < 1_500_000


def test_the_maps_carry_their_verdicts_as_signs_not_as_colour_alone(written):
    page = (written / "slivers.html").read_text(encoding="utf-8")
    cells = re.findall(r'<td class="(good|fair|poor|bad)"[^>]*>(.)', page)
    signs = {"good": "●", "fair": "◐", "poor": "○", "bad": "✕"}
    assert {grade for grade, _ in cells} == set(signs)
    assert all(signs[grade] == sign for grade, sign in cells)


def test_rendering_again_gives_the_same_page(written):
    before = (written / "slivers.html").read_bytes()
    assert render_study(written, "slivers").read_bytes() == before


def test_a_missing_broken_or_foreign_record_is_refused(tmp_path):
    with pytest.raises(InputError, match="has not run"):
        render_study(tmp_path, "slivers")
    (tmp_path / "slivers.json").write_text("{")
    with pytest.raises(InputError, match="not a JSON file"):
        render_study(tmp_path, "slivers")
    for record in ({"schema": 2, "kind": "slivers study"}, {"schema": 1, "kind": "other"}, []):
        (tmp_path / "slivers.json").write_text(json.dumps(record))
        with pytest.raises(InputError, match="expected"):
            render_study(tmp_path, "slivers")


@pytest.mark.parametrize(
    "arguments",
    [
        ["study"],
        ["study", "slivers"],
        ["study", "slivers", "--dimension", "4", "--out", "x"],
        ["study", "energy", "--dimension", "2", "--out", "x"],
        ["study", "cracks", "--out", "x"],
    ],
)
def test_wrong_arguments_are_refused_in_one_line(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_file_in_the_place_of_the_directory_is_found_out_before_anything_runs(tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    assert main(["study", "slivers", "--out", str(tmp_path / "taken")]) == 2
    said = capsys.readouterr().err
    assert "expected a directory" in said
    assert "conditioning" not in said

"""The page of speed is what the command writes; its rows of solvers that others have run."""

import json

import pytest
from speed_table import COLUMNS, PAGE, page, read, write


def test_the_page_is_that_of_the_record():
    assert PAGE.read_text(encoding="utf-8") == page(read())


def test_a_row_takes_the_place_of_the_one_with_its_name(tmp_path):
    record = tmp_path / "speed.csv"
    row = ["cut", "a pass", "10", "2.00", "3", "0.9"]
    write({("cut", "a pass", "10"): row, ("step", "a pass", "10"): ["step", *row[1:]]}, record)
    write({("cut", "a pass", "10"): [*row[:3], "1.00", *row[4:]]}, record)
    assert [found[3] for found in read(record).values()] == ["1.00", "2.00"]
    table = record.with_suffix(".md").read_text(encoding="utf-8").splitlines()[-4:]
    assert table[0] == "| " + " | ".join(COLUMNS) + " |"
    assert table[2] == "| cut | a pass | 10 | 1.00 | 3 | 0.9 |"


@pytest.mark.timing
@pytest.mark.parametrize(
    ("solver", "most"), [("ngsxfem", 0.5), ("getfem", 0.5), ("kratos", None), ("akantu", None)]
)
def test_no_solver_that_cuts_elements_is_quicker_at_equal_error_in_the_arena(solver, most, speed):
    """Kratos and Akantu are given meshes that conform to the cut: nothing is asked beside them."""
    pairs = json.loads((PAGE.parent / "arena" / "ranking.json").read_text("utf-8"))["pairs"]
    asked = {"metric": "time", "kind": "rest", "solver": "xfem", "rival": solver}
    (pair,) = (one for one in pairs if asked.items() <= one.items())
    cases = f"{pair['count']} cases at rest"
    speed("arena, time at equal L² error", solver, cases, pair["ratio"], most)
    assert most is None or pair["ratio"] < most

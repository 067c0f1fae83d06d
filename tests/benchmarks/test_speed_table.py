"""The page of speed is what the command writes; its rows of solvers that others have run."""

import csv
import gzip

import numpy as np
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


def finest_at_equal_error(solver):
    """Seconds of `xfem` over those of a solver of the arena, a ratio for each case.

    At the least L² error of the solver that `xfem` brackets, between its levels, in logarithms.
    """
    curves = {}
    with gzip.open(PAGE.parent / "arena" / "results.csv.gz", "rt", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            measured = row["value"] and row["seconds_median"] and not row["parameters"]
            if row["metric"] == "displacement_l2" and measured:
                numbers = float(row["value"]), float(row["seconds_median"])
                curves.setdefault((row["solver"], row["case"]), []).append(numbers)
    ratios = []
    for (name, case), curve in curves.items():
        errors, seconds = np.array(sorted(curves.get(("xfem", case), [(0.0, 1.0)]))).T
        within = [point for point in curve if errors[0] <= point[0] <= errors[-1]]
        # an error of round-off is none to compare a time at
        if name == solver and errors[0] > 1e-9 and len(errors) > 1 and within:
            error, other = min(within)
            own = np.interp(np.log(error), np.log(errors), np.log(seconds))
            ratios.append(np.exp(own) / other)
    return ratios


@pytest.mark.timing
@pytest.mark.parametrize(
    ("solver", "most"), [("ngsxfem", 1.0), ("getfem", 1.0), ("kratos", None), ("akantu", None)]
)
def test_no_solver_that_cuts_elements_is_quicker_at_equal_error_in_the_arena(solver, most, speed):
    """Kratos and Akantu are given meshes that conform to the cut: nothing is asked beside them."""
    ratios = finest_at_equal_error(solver)
    mean = float(np.exp(np.mean(np.log(ratios))))
    speed("arena, time at equal L² error", solver, f"{len(ratios)} cases", mean, most)
    assert most is None or mean < most

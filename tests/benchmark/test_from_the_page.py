"""Programs that readers wrote who had a page of the benchmark and nothing else of the project.

Each prints its values with its own error, by a rule that was set beforehand. It compares them with
both columns of the page.
"""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAMS = Path(__file__).with_name("from_the_page")


def rows_of(program):
    ran = subprocess.run(
        [sys.executable, PROGRAMS / program], capture_output=True, text=True, check=True
    )
    print(ran.stdout)
    rows = (line for line in ran.stdout.splitlines() if "|" in line or "page" in line)
    return {line.split()[0]: line for line in rows}


@pytest.mark.heavy
def test_a_reader_of_c2_hits_the_first_route():
    """Each within both intervals; the page names two whose half-widths look too narrow."""
    rows = rows_of("c2_from_the_page.py")
    assert len(rows) == 15
    assert not any("DOES NOT AGREE" in row for row in rows.values())
    assert {name for name in rows if "within both" in rows[name]} <= {
        "K_II_flat_start", "K_I_steep_start", "K_II_steep_start", "K_II_steep_end",
    }  # fmt: skip


@pytest.mark.heavy
def test_a_reader_of_c4_hits_both_columns():
    rows = rows_of("c4_from_the_page.py")
    own = {name: row.split() for name, row in rows.items() if name != "output"}
    assert len(own) == 26
    assert not any("NO" in row for row in own.values())
    assert all(row.count("yes") == 2 for row in own.values())


@pytest.mark.heavy
def test_a_reader_of_c6_hits_both_columns_but_the_first_of_the_last_opening():
    """The page says so: the half-width of `opening_3` by the first route looks too narrow."""
    rows = rows_of("c6_from_the_page.py")
    outputs = [name for name in rows if name.startswith(("opening", "fall", "momentum"))]
    assert len(outputs) == 6
    missed = {name for name in outputs if "DIFFER" in rows[name]}
    assert missed <= {"opening_3"}
    assert rows["opening_3"].split("|")[1].split(";")[1].endswith("agree")

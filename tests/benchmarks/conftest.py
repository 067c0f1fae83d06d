"""The fixture by which claims about time enter the table of speed."""

import os

import pytest
from speed_table import write


@pytest.fixture(scope="session")
def speed():
    """Function (what, beside, size, ratio, most, exponent) that adds a row; VERIFY_SPEED writes."""
    rows = {}

    def add(what, beside, size, ratio, most, exponent=""):
        most = f"{most:.3g}" if most else "–"
        rows[what, beside, size] = [what, beside, size, f"{ratio:.3g}", most, exponent]

    yield add
    if rows and "VERIFY_SPEED" in os.environ:
        write(rows)

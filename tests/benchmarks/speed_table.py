"""One table of speed: rows that the claims about time leave in a record, and the page made of it.

`make bench` measures what is not heavy and writes both; rows of heavy claims stay as they are until
`VERIFY_SPEED=1 pytest -m heavy tests/benchmarks` measures them again.
"""

import csv
from pathlib import Path

RECORD = Path(__file__).parents[2] / "docs" / "results" / "speed.csv"
PAGE = RECORD.with_suffix(".md")
COLUMNS = ("what", "beside", "size", "ratio", "at most", "exponent")
TEXT = """# Speed, as ratios

Written by `make bench` from [speed.csv](speed.csv), one thread, processor time. Seconds depend on
the machine: a row is a ratio to a peer or to a limit of the machine, both measured in one run, in
turns, medians; what it is held to stands beside it. The exponent is that of the growth of the own
time with the size of the mesh, in brackets that of the peer. SOFA was run on another machine: its
recorded times are scaled by the memory bandwidth of both. Times of the arena are those of its
[published run](arena/index.md). Which solver is taken when:
[linear solvers](../theory/linear-solvers.md).

"""


Rows = dict[tuple[str, ...], list[str]]  # by their first three columns


def read(record: Path = RECORD) -> Rows:
    """Return the rows of a record, as texts."""
    if not record.exists():
        return {}
    with record.open(newline="", encoding="utf-8") as file:
        return {tuple(row[:3]): row for row in list(csv.reader(file))[1:]}


def page(rows: Rows) -> str:
    """Return the page of a record."""
    lines = ["| " + " | ".join(row) + " |" for row in [COLUMNS, *rows.values()]]
    lines.insert(1, "|---|---|---|---|---|---|")
    return TEXT + "\n".join(lines) + "\n"


def write(measured: Rows, record: Path = RECORD) -> None:
    """Put rows into a record, each in the place of the one with its name, and write the page."""
    rows = read(record) | measured
    with record.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows.values()])
    record.with_suffix(".md").write_text(page(rows), encoding="utf-8")

"""The thesis' own numbers: tables 4.1 to 4.6 of Gutiérrez Preciado (CINVESTAV, 2009)."""

import json
from functools import cache
from importlib.resources import files


@cache
def _tables() -> dict[str, dict[str, list[list[float]]]]:
    text = files("verify.simulator.thesis").joinpath("published.json").read_text(encoding="utf-8")
    tables: dict[str, dict[str, list[list[float]]]] = json.loads(text)
    return tables


def published_rows(table: str) -> list[list[float]]:
    """Return the rows of a table as printed, such as ``"4.3"``."""
    return [list(row) for row in _tables()[table]["rows"]]


def published_source() -> str:
    """Return where they were published."""
    return str(_tables()["source"])

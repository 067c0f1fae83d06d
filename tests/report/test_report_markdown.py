"""Claims about the report as Markdown and as PDF."""

import re

import pytest
from page_parser import parsed
from synthetic_run import make_run

from verify.report import render_markdown


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = make_run(tmp_path_factory.mktemp("markdown") / "run")
    return root, render_markdown(root).read_text(encoding="utf-8")


def test_every_table_has_rows_of_one_width_and_holds_the_numbers_of_the_page(written):
    root, text = written
    page = parsed((root / "report.html").read_text(encoding="utf-8"))
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert len(tables) == len(page.all("table"))
    for table in tables:
        rows = table.splitlines()
        widths = {len(re.findall(r"(?<!\\)\|", row)) for row in rows}
        assert len(widths) == 1, rows[0]
    for words in ("8.0787579", "UNDECIDED", "killed after 60 s", "×10⁻"):
        assert words in text

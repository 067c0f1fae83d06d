"""Claims about the report as Markdown and as PDF."""

import re
import shutil
from xml.etree import ElementTree

import pytest
from page_parser import parsed
from PIL import Image
from small_disk import by_command, named_until_it_fits, small_disk
from synthetic_run import make_run

from verify.cli import main
from verify.errors import InputError
from verify.report import render_markdown, render_pdf
from verify.report.printing import BROWSERS
from verify.report.template_sets import PICTURES


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = make_run(tmp_path_factory.mktemp("markdown") / "run")
    return root, render_markdown(root).read_text(encoding="utf-8")


def shown(text):
    return re.findall(r"!\[[^\n]*?\]\(([^)\s]+)\)", text)


def test_every_picture_of_the_page_lies_beside_the_markdown_and_opens(written):
    root, text = written
    page = parsed((root / "report.html").read_text(encoding="utf-8"))
    named = shown(text)
    assert len(named) == len(set(named)) == len(page.all("img")) - 1 + len(page.all("svg"))
    assert {f"{PICTURES}/{p.name}" for p in (root / PICTURES).iterdir()} == set(named)
    for name in named:
        if name.endswith(".png"):
            with Image.open(root / name) as image:
                assert min(image.size) > 50
        else:
            svg = (root / name).read_text(encoding="utf-8")
            ElementTree.fromstring(svg)


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


def test_words_of_a_case_file_cannot_become_markup(tmp_path):
    root = make_run(tmp_path / "run", pictures=False, hostile=True)
    text = render_markdown(root).read_text(encoding="utf-8")
    assert "<script" not in text
    assert "&lt;script&gt;" in text


def test_without_a_browser_pdf_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    root = make_run(tmp_path / "run", pictures=False)
    monkeypatch.setattr("verify.report.printing.shutil.which", lambda name: None)
    with pytest.raises(InputError, match="PDF needs Chromium"):
        render_pdf(root)
    monkeypatch.setattr("sys.argv", ["verify", "report", str(root), "--format", "pdf"])
    assert main() == 2
    assert "--format" in capsys.readouterr().err


def test_a_report_in_markdown_that_does_not_fit_exits_with_3(tmp_path, capsys):
    with small_disk(tmp_path / "disk", "2m") as disk:
        run = make_run(disk.root / "run", pictures=False)
        for case in ("statics__griffith_inside", "statics__tissue_strip"):  # one is enough
            shutil.rmtree(run / "cases" / case)
        command = ("report", run, "--format", "markdown")
        named = named_until_it_fits(disk, by_command(capsys, *command))
    assert "run/results.json" in named
    assert any(name.startswith(f"run/{PICTURES}") for name in named)


@pytest.mark.browser
def test_the_pdf_has_pages(tmp_path):
    if not any(map(shutil.which, BROWSERS)):
        pytest.skip(f"no Chromium here (looked for {', '.join(BROWSERS)})")
    root = make_run(tmp_path / "run", pictures=False)
    pdf = render_pdf(root).read_bytes()
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 2

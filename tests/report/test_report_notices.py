"""Notices of a case: nobody can miss a warning, and what cannot be had stands with its reason."""

from dataclasses import replace

import pytest
from page_parser import parsed
from synthetic_run import make_run

from verify.report import render
from verify.result import Notice, NoticeKind
from verify.result_files import read_result, write_result

CLOSED = "its faces overlap by up to 18.5 mm at (0.05, 0.05) m"
NO_TIP = "the end of the arc (0.1, 0) m is no tip"


@pytest.fixture(scope="module")
def warned(tmp_path_factory):
    root = make_run(tmp_path_factory.mktemp("warned") / "run", pictures=False)
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    notices = [
        Notice(NoticeKind.WARNING, "cut 0", "xfem", CLOSED),
        Notice(NoticeKind.UNAVAILABLE, "K_I", None, NO_TIP),
    ]
    write_result(replace(read_result(file), notices=notices), file)
    render(root)
    return root, read_result(file)


def test_a_warning_stands_on_top_of_the_case_in_the_summary_and_beside_the_badge(warned):
    page = (warned[0] / "report.html").read_text()
    top, case = page.index("Warned of"), page.index('id="case-1"')
    assert top < case
    assert "statics/f3_inclined" in page[top : top + 200]  # which case; its banner says the rest
    matrix = page.index('<table class="matrix">')
    assert matrix < page.index("1 warning", matrix) < case
    inside = page[case:]
    banner = inside.index('class="banner"')
    assert banner < inside.index("<table")
    assert CLOSED in inside[banner : banner + 400]
    assert inside.index("1 warning") < banner
    parsed(page)

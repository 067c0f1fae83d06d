"""Claims about the pages of studies: both forms from one record, its numbers, no markup."""

import numpy as np
import pytest
from page_parser import parsed
from synthetic_studies import HOSTILE, STUDIES

from verify.report.figures import studies as figures
from verify.report.figures.style import Palette
from verify.report.study_page import render_study


@pytest.mark.parametrize("kind", STUDIES)
def test_page_and_markdown_say_the_same_and_no_text_of_a_record_becomes_markup(studies, kind):
    text = render_study(studies, kind).read_text(encoding="utf-8")
    page = parsed(text)
    assert HOSTILE in page.text
    assert "alert(1)</script>" not in text
    markdown = render_study(studies, kind, "markdown").read_text(encoding="utf-8")
    assert "a\\|b &lt;script&gt;alert(1)&lt;/script&gt; \\`x\\` \\*y\\*" in markdown
    for said in ("1 finding: 0 passed, 1 failed, 0 undecided.", "Seen: 2 of 3."):
        assert said in page.text
        assert said in markdown
    assert markdown.count("![") == len(page.all("svg"))
    assert all((studies / name).is_file() for name in pictures(markdown))


def pictures(markdown):
    return [part.split(")")[0] for part in markdown.split("](")[1:]]


def test_numbers_of_studies_are_those_of_the_record(studies):
    texts = {k: render_study(studies, k).read_text(encoding="utf-8") for k in STUDIES}
    for kind, said in (
        ("slivers", "◐ 0.899"), ("slivers", "◐ 1004"),
        ("slivers", "∝ ε^0.00"), ("energy", "XFEM scheme=x"), ("energy", "2.50×10⁻¹³"),
        ("cost", "500 ms (400–600)"), ("cost", "not reached"), ("cost", "2.5 ms"),
        ("budget", "−2.03 %"), ("budget", "round-off"), ("budget", "it ran away"),
        ("calibration", "2.00"), ("calibration", "1 marks, 0 not covered"),
    ):  # fmt: skip
        assert said in texts[kind], (kind, said)


def test_a_place_that_is_not_known_is_a_gap_of_the_curve_and_not_bridged(monkeypatch):
    kept = []

    def keep(figure, alt):
        kept.extend(line.get_xydata() for line in figure.axes[0].lines)
        return alt

    monkeypatch.setattr(figures, "drawing", keep)
    places = [(0.25, 0.1), (None, 0.01), (4.0, 0.0), (8.0, 1e-3), (16.0, 1e-4)]
    said = figures.loglog("error", "time", [figures.Series("strain energy", places)], Palette())
    (curve,) = kept
    assert np.isfinite(curve).all(axis=1).tolist() == [True, False, False, True, True]
    assert curve[3:] == pytest.approx(np.array([(8.0, 1e-3), (16.0, 1e-4)]))
    assert "strain energy: 0.1 at 0.25, 0.001 at 8, 0.0001 at 16." in said

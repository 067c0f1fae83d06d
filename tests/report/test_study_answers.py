"""Answers of studies: sentences with thresholds, curves that are joined, broken and named."""

import re
from itertools import pairwise

import pytest
from synthetic_studies import measured

from verify.report import plots as figures
from verify.report.plots import Palette, Series, loglog
from verify.report.sliver_page import sliver_families, sliver_lead
from verify.report.study_page import _said, iterations_lead

STEP, UNCUT = "critical explicit step", "critical explicit step, uncut"
SIZES = (0.1, 1e-3, 1e-6)


def record(errors, steps=None, unknowns=None):
    """Errors of the displacement and steps by solver, one for each size."""
    rows = [
        measured(solver, size, name, value)
        for name, values in (
            ("displacement_l2", errors), (STEP, steps or {}),
            ("unknowns of the system", unknowns or {}),
        )
        for solver, own in values.items()
        for size, value in zip(SIZES, own, strict=True)
    ]  # fmt: skip
    rows += [measured(solver, size, UNCUT, 2.0) for solver in steps or {} for size in SIZES]
    return {"measurements": rows, "growths": []}


EQUAL = {"xfem": (0.1, 0.1, 0.1), "conforming": (0.1, 0.1, 0.1)}


def test_a_step_is_kept_from_nine_tenths_on_and_who_loses_it_is_named_with_its_least():
    steps = {"xfem": (2.0, 1.9, 1.8), "conforming": (1.0, 0.01, 1e-5)}
    said = sliver_lead(record(EQUAL, steps)).sentences[0]
    assert "at every ε by XFEM (0.90)." in said
    assert "It falls with conforming P1 (5.0×10⁻⁶ at ε = 1e-06)." in said
    steps["xfem"] = (2.0, 1.9, 1.79)
    said = sliver_lead(record(EQUAL, steps)).sentences[0]
    assert "left at every ε by nobody." in said
    assert "XFEM (0.90 at ε = 1e-06)" in said
    assert "No explicit step was measured" in sliver_lead(record(EQUAL)).sentences[0]


def test_an_error_grows_above_a_quarter_more_than_that_of_a_conforming_mesh():
    errors = {**EQUAL, "subdivision": (0.1, 0.124, 0.1)}
    assert "at most 1.24 times" in sliver_lead(record(errors)).sentences[1]
    errors["subdivision"] = (0.1, 0.1, 0.2)
    said = sliver_lead(record(errors)).sentences[1]
    assert said.startswith(
        "More than 1.25 times the error of a conforming mesh of the same size has"
    )
    assert "subdivision (most: 2.00 times" in said
    del errors["conforming"]
    assert "not compared" in sliver_lead(record(errors)).sentences[1]


@pytest.mark.parametrize(("worst", "first", "second"), [
    ((1.0, 1.04, 1.3, 7.6), "Up to g = 1 it adds no error: at every ε none is more than 4.0 %",
     "From 10 on errors grow, and it locks: displacement, L² +30 % at 10; displacement, L² 7.6"),
    ((1.0, 1.04, 7.5, 7.6), "Up to g = 1 it adds no", "7.6 times at 100. Beyond 10 none grows"),
    ((1.0, 1.01, 1.02, 1.03), "Up to g = 100 it adds no", "Larger values were not tried: 100"),
    ((1.1, 1.2, 1.3, 7.7), "Every g above the least, 0.1, adds more than 5%", "7.0 times at 100"),
])  # fmt: skip
def test_a_number_that_is_swept_costs_nothing_up_to_a_twentieth_more(worst, first, second):
    """Each factor holds at one size; beside the least value, not beside the conforming mesh."""
    errors = {f"other g={g:g}": (0.1, 0.1 * w, 0.1)
              for g, w in zip((0.1, 1.0, 10.0, 100.0), worst, strict=True)}  # fmt: skip
    lead = sliver_lead(record({"conforming": (0.1, 0.1, 0.1), **errors}))
    assert lead.question == "What does g do to the error?"
    assert lead.sentences[0].startswith(first)
    assert len(lead.sentences) == 2
    assert second in lead.sentences[-1]
    (drawn,) = lead.panels
    assert f"{worst[3] / worst[0]:.3g} at 100" in drawn.alt
    assert f"at most: displacement, L² {worst[0]:.2f}" in lead.caption


def test_curves_that_nobody_can_tell_apart_are_one_and_end_where_unknowns_change(monkeypatch):
    kept = {}

    def keep(figure, alt):
        kept.update({line.get_label(): line.get_xydata() for line in figure.axes[0].lines})
        return alt

    monkeypatch.setattr(figures, "drawing", keep)
    steps = {"xfem": (2.0, 2.0, 2.0), "xfem slivers=merge": (1.98, 2.0, 2.0),
             "subdivision": (0.2, 2e-3, 2.0)}  # fmt: skip
    unknowns = {"xfem": (50, 50, 50), "xfem slivers=merge": (50, 50, 50),
                "subdivision": (60, 60, 50)}  # fmt: skip
    sliver_lead(record(EQUAL, steps, unknowns))
    assert set(kept) == {"XFEM, slivers=merge", "subdivision"}
    places = kept["subdivision"]
    assert [x for x in places[:, 0] if x == x] == [0.1, 1e-3, 1e-6]  # falling
    assert len(places) == 4  # no line from the split mesh to the cut on nodes
    assert places[2] != pytest.approx(places[2], nan_ok=False)


def test_panels_of_one_page_tell_by_their_titles_what_they_hold():
    """Eight variants, one of which stands in a panel with the others."""
    names = [*(f"xfem mass={n}" for n in range(8)), "conforming", "subdivision"]
    errors = {name: (0.1, 0.1 * (k + 1), 0.1) for k, name in enumerate(names)}
    ((family,), own) = sliver_families(record(errors)), "relative L² error of the displacement"
    titles = [panel.alt.partition(" against ")[0] for panel in family["curves"]]
    assert titles == [
        f"{own}: variants of XFEM, 1 of 2", f"{own}: variants of XFEM, 2 of 2",
        f"{own}: XFEM beside others",
    ]  # fmt: skip


@pytest.mark.parametrize("count", [1, 6])
def test_names_stand_at_the_ends_inside_the_drawing_and_none_on_another(count):
    """All curves end in one place: the worst case for their names."""
    words = "a name that takes three lines since it is rather long"
    series = [Series(f"{words} {n}", [(1.0, 1.0 + n), (2.0, 3.0)]) for n in range(count)]
    drawn = loglog("error", "x", series, Palette())
    texts = re.findall(r"<text[^>]*translate\(([\d.]+) ([\d.]+)\)[^>]*>([^<]*)</text>", drawn.body)
    named = [(float(x), float(y)) for x, y, text in texts if text in words or text[:-2] in words]
    named = [place for place in named if place[0] > 0.55 * drawn.size[0]]
    assert len(named) == 3 * count
    assert len({x for x, _ in named}) == 1
    assert all(0.0 < y < drawn.size[1] for _, y in named)
    heights = sorted(y for _, y in named)
    assert all(b - a > 8.0 for a, b in pairwise(heights))


def setting(iterations, substeps, iteration_error, whole_error, case="c"):
    return {"case": case, "iterations": iterations, "substeps": substeps,
            "iteration_error": iteration_error, "whole_error": whole_error}  # fmt: skip


def test_substeps_pay_where_the_whole_error_at_equal_work_is_a_fifth_less():
    def said(other):
        rows = [setting(4, 1, 0.5, 0.5), setting(8, 1, 0.02, 0.1), setting(2, 4, 0.005, other)]
        return iterations_lead({"solver": "s", "tolerance": 0.01, "settings": rows}).sentences

    iterations, substeps = said(0.079)
    assert (
        "within 1 % of the same steps, solved to convergence: 8 (c, 2 in each of 4 substeps)."
        in iterations
    )
    assert substeps.startswith("Substeps pay at equal work, on all 1 cases.")
    assert "c, 8 iterations: 0.079 with 4 substeps, 0.10 with 1" in substeps
    assert said(0.081)[1].startswith("Substeps do not pay at equal work on any of 1 cases.")
    never = {"solver": "s", "tolerance": 0.01, "settings": [setting(8, 1, 0.02, 0.1)]}
    sentence = iterations_lead(never).sentences[0]
    assert sentence.startswith("No number comes within 1 % of the same steps, solved to")
    assert "8 are not enough on c" in sentence


def test_whose_claim_fails_is_said_in_words_and_numbers():
    def finding(whose, verdict, topic):
        return {"topic": topic, "expected": f"{topic} holds", "verdict": verdict, "whose": whose,
                "sentence": f"{topic} is 33 % (7 %); and so on; more"}  # fmt: skip

    said = _said([
        finding("the thesis", "PASS", "a"), finding("the thesis", "FAIL", "b"),
        finding("this project", "UNDECIDED", "c"),
    ])  # fmt: skip
    assert said == [
        "Of 2 claims of the thesis 1 hold. Failed: b holds (b is 33 % (7 %)).",
        "Of 1 claims of this project 0 hold. Undecided: c holds (c is 33 % (7 %)).",
    ]

"""Answers of studies: sentences with thresholds, curves that are joined, broken and named."""

import re
from itertools import pairwise

import pytest
from synthetic_studies import measured

from verify.report import plots as figures
from verify.report.iterations_page import iterations_lead, iterations_panels, substeps_panels
from verify.report.plots import Palette, Series, loglog
from verify.report.sliver_page import sliver_families, sliver_lead
from verify.report.study_page import _said

STEP, UNCUT = "critical explicit step", "critical explicit step, uncut"
LUMPED, FREQUENCY = f"{UNCUT} and lumped", "lowest natural frequency"
SIZES = (0.1, 1e-3, 1e-6)


def record(errors, steps=None, unknowns=None, lumped=None, **more):
    """Errors of the displacement and steps by solver, one for each size; uncut steps are 2."""
    rows = [
        measured(solver, size, name, value)
        for name, values in (
            ("displacement_l2", errors), (STEP, steps or {}),
            ("unknowns of the system", unknowns or {}), *more.items(),
        )
        for solver, own in values.items()
        for size, value in zip(SIZES, own, strict=True)
    ]  # fmt: skip
    rows += [measured(solver, size, UNCUT, 2.0) for solver in steps or {} for size in SIZES]
    for solver, step in (lumped or {}).items():
        rows += [measured(solver, size, LUMPED, step) for size in SIZES]
    return {"measurements": rows, "growths": []}


EQUAL = {"xfem": (0.1, 0.1, 0.1), "conforming": (0.1, 0.1, 0.1)}


def test_a_step_is_kept_from_nine_tenths_on_and_who_loses_it_is_named_with_its_least():
    steps = {"xfem": (2.0, 1.9, 1.8), "conforming": (1.0, 0.01, 1e-5)}
    said = sliver_lead(record(EQUAL, steps)).sentences[0]
    assert "left at every ε by XFEM (0.90)." in said
    assert "It falls like ε, until the cut is on nodes, with conforming P1 (5.0×10⁻⁶" in said
    steps["xfem"] = (2.0, 1.9, 1.79)
    said = sliver_lead(record(EQUAL, steps)).sentences[0]
    assert "left at every ε by nobody." in said
    assert "A smaller share is left, however near, by XFEM (0.90)." in said
    assert "No explicit step was measured" in sliver_lead(record(EQUAL)).sentences[0]


def test_a_step_that_falls_like_its_slivers_is_told_from_one_that_stays_and_one_that_recovers():
    """Of an uncut step of 2: in proportion to ε; a tenth, at last or ever; less at 0.1 alone."""
    steps = {"subdivision": (0.2, 2e-3, 2.0), "xfem mass=evs": (0.5, 0.201, 0.2),
             "other": (0.2, 0.2, 0.2), "snapping": (0.8, 1.9, 2.0)}  # fmt: skip
    said = sliver_lead(record(EQUAL, steps)).sentences[0]
    falls = "It falls like ε, until the cut is on nodes, with"
    assert f"{falls} subdivision (0.0010 at ε = 0.001)." in said
    assert (
        "A smaller share is left, however near, by XFEM mass=evs (0.10) and other (0.10)." in said
    )
    at_nodes = [measured("xfem", *row) for row in ((0.1, STEP, 2.0), (0.0, STEP, 1.0),
                                                   (0.1, UNCUT, 2.0))]  # fmt: skip
    of_nodes = sliver_lead({"measurements": at_nodes, "growths": []}).sentences[0]
    assert "A smaller share is left, however near, by XFEM (0.50)." in of_nodes
    far = "Far from nodes alone less is left by snapping"
    assert f"{far} (0.40 at ε = 0.1, at least 0.95 nearer)" in said


def test_masses_are_named_by_their_uncut_steps_and_the_price_of_a_lumped_one_is_said():
    """One mesh: 2 s with the mass of each, 2 s with a lumped one too, or 4 s."""
    steps = dict.fromkeys(("xfem", "xfem mass=consistent", "conforming"), (2.0, 2.0, 2.0))
    lumped = {"xfem": 2.0, "xfem mass=consistent": 4.0, "conforming": 4.0}
    pitch = {"xfem": (0.9, 0.87, 0.88), "xfem mass=consistent": (1.0, 1.02, 1.0),
             "conforming": (1.0, 1.0, 1.0)}  # fmt: skip
    found = record(EQUAL, steps, lumped=lumped, **{FREQUENCY: pitch})
    lead = sliver_lead(found)
    assert (
        "by XFEM (lumped, 1.0), conforming P1 (consistent, 1.0) and XFEM mass=cons"
        in lead.sentences[0]
    )
    assert "−13.0 % with lumped masses (XFEM, f) and +2.0 % with consistent" in lead.sentences[1]
    ((family,),) = (sliver_families(found),)
    (table,) = [one for one in family["tables"] if "explicit step and system" in one.caption]
    assert [[cell.text for cell in row[:5]] for row in table.rows] == [
        ["XFEM", "lumped", "2.00", "1.00", "1.00"],
        ["conforming P1", "consistent", "2.00", "1.00", "0.500"],
        ["XFEM mass=consistent", "consistent", "2.00", "1.00", "0.500"],
    ]  # fmt: skip


def test_an_error_grows_above_a_quarter_more_than_that_of_a_conforming_mesh():
    errors = {**EQUAL, "subdivision": (0.1, 0.124, 0.1)}
    said = sliver_lead(record(errors)).sentences[1]
    assert said.startswith("No error grows as the cut comes near nodes.")
    assert "at ε = 0.1 and nearer: displacement and energy norm 1.00, 1.24." in said
    errors["subdivision"] = (0.1, 0.1, 0.2)
    said = sliver_lead(record(errors)).sentences[1]
    assert said.startswith("Near nodes, ε ≤ 0.01, an error grows beyond 1.25 times a conforming")
    assert "displacement and energy norm (subdivision, 2.00 times)" in said
    del errors["conforming"]
    assert "not compared" in sliver_lead(record(errors)).sentences[1]


def test_jump_and_opening_are_said_apart_and_what_is_large_far_from_nodes_alone_is_no_growth():
    jump = {"xfem": (0.189, 0.1, 0.1), "conforming": (0.1, 0.1, 0.1)}
    opening = {"xfem": (0.3, 0.1, 0.11), "conforming": (0.1, 0.1, 0.1)}
    largest = {"xfem": (0.45, 0.1, 0.1), "conforming": (0.1, 0.1, 0.1)}
    found = record(EQUAL, jump_l2=jump, opening_l2=opening, opening_max=largest)
    said = sliver_lead(found).sentences[1]
    assert said.startswith("No error grows as the cut comes near nodes.")
    assert "norm 1.00, 1.00; jump 1.89, 1.00; opening 4.50, 1.10. Far from nodes a conf" in said
    (family,) = sliver_families(found)
    (worst,) = [table for table in family["tables"] if "errors over" in table.caption]
    assert [cell.text for cell in worst.rows[0]] == [
        "XFEM", "1.00", "–", "1.89 at 0.1", "3.00 at 0.1", "4.50 at 0.1"]  # fmt: skip
    assert family["alike"] == ["displacement, L²"]
    captions = [table.caption for table in family["tables"]]
    assert "jump, L²: error over that of a conforming mesh" in captions
    jump["xfem"] = (0.1, 0.1, 0.126)
    said = sliver_lead(record(EQUAL, jump_l2=jump)).sentences[1]
    assert "an error grows beyond 1.25 times a conforming mesh's: jump (XFEM, 1.26 times)" in said


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
    assert len(lead.sentences) == 3
    assert second in lead.sentences[1]
    assert "What it gains is not measured here: other hands over no system" in lead.sentences[2]
    (drawn,) = lead.panels
    assert f"{worst[3] / worst[0]:.3g} at 100" in drawn.alt
    assert drawn.alt.startswith("largest over ε of the error over that at g = 0.1")
    assert f"at most: displacement, L² {worst[0]:.2f}" in lead.caption


@pytest.fixture
def kept(monkeypatch):
    """Hold the drawn curves, by their labels."""
    found = {}

    def keep(figure, alt):
        found.update({line.get_label(): line.get_xydata() for line in figure.axes[0].lines})
        return alt

    monkeypatch.setattr(figures, "drawing", keep)
    return found


def test_curves_that_nobody_can_tell_apart_are_one_and_end_where_unknowns_change(kept):
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


@pytest.mark.parametrize(("values", "gap"), [
    ((2.0, 0.02, 2e-5), False),  # falls on with its power of ε: corners were below round-off
    ((2.0, 0.02, 2.0), True),  # the cut is on nodes
    ((2.0, 2.0, 1.97), False), ((2.0, 2.0, 0.02), True),
])  # fmt: skip
def test_a_curve_goes_on_where_unknowns_change_and_its_law_does_not(kept, values, gap):
    steps = {"xfem mass=consistent": values, "xfem": (2.0, 2.0, 1.0)}
    unknowns = {"xfem mass=consistent": (198, 198, 196), "xfem": (50, 50, 50)}
    sliver_lead(record(EQUAL, steps, unknowns))
    assert len(kept["XFEM mass=consistent"]) == 3 + gap


def test_panels_of_one_page_tell_by_their_titles_what_they_hold():
    """Eight variants, one of which stands in a panel with the others."""
    names = [*(f"xfem mass={n}" for n in range(8)), "snapping", "subdivision"]
    errors = {name: (0.1, 0.1 * (k + 1), 0.1) for k, name in enumerate(names)}
    ((family,), own) = sliver_families(record(errors)), "relative L² error of the displacement"
    titles = [panel.alt.partition(" against ")[0] for panel in family["curves"]]
    assert titles == [
        f"{own}: variants of XFEM, 1 of 2", f"{own}: variants of XFEM, 2 of 2",
        f"{own}: XFEM beside others",
    ]  # fmt: skip


def test_one_of_many_is_in_no_table_and_no_panel():
    """Of a solver that hands over no system, errors alone."""
    errors = {"conforming": (0.1, 0.1, 0.1), "ngsxfem": (0.1, 0.2, 0.1), "getfem": (0.1, 0.3, 0.1)}
    steps = {"conforming": (2.0, 0.1, 1e-3)}
    (family,) = sliver_families(record(errors, steps, **{"condition number": steps}))
    assert family["curves"] == []
    assert len(family["tables"]) == 2
    assert all("error" in table.caption for table in family["tables"])


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


def setting(iterations, substeps, iteration_error, whole_error, case="c", **more):
    return {"case": case, "iterations": iterations, "substeps": substeps, "seconds": None,
            "time_step": 1e-3 / substeps, "iteration_error": iteration_error,
            "whole_error": whole_error, **more}  # fmt: skip


def said_of(rows, left_out=None):
    record = {"solver": "s", "tolerance": 0.01, "settings": rows, "left_out": left_out or {}}
    return iterations_lead(record).sentences


def test_substeps_pay_where_the_whole_error_at_equal_work_is_a_fifth_less():
    def said(other):
        return said_of(
            [setting(4, 1, 0.5, 0.5), setting(8, 1, 0.02, 0.1), setting(2, 4, 0.005, other)]
        )

    iterations, substeps = said(0.079)
    assert (
        "within 1 % of the same steps, solved to convergence: 8, 2 in each of 4 substeps (c)."
        in iterations
    )
    assert substeps.startswith("Substeps pay at equal work on the one case in motion.")
    assert "c, 8 iterations: 0.079 with 4 substeps, 0.10 with 1" in substeps
    assert said(0.081)[1].startswith("Substeps do not pay at equal work on the one case in motion")
    sentence = said_of([setting(8, 1, 0.02, 0.1)])[0]
    assert sentence.startswith("No number comes within 1 % of the same steps, solved to")
    assert "8 are not enough on c" in sentence


def test_what_iterations_cannot_lower_is_told_from_what_they_can():
    """Steps met with 10, whose own error is 1.5 %; with four substeps nothing falls any more."""
    rows = [setting(10, 1, 4e-5, 0.015, seconds=2.0), setting(160, 1, 4e-9, 0.015, seconds=25.6),
            setting(None, 1, 0.0, 0.015, seconds=4.99), setting(10, 4, 1.07e-3, 0.0035),
            setting(40, 4, 1.1e-3, 0.0035), setting(None, 4, 0.0, 0.003)]  # fmt: skip
    said = said_of(rows)[0]
    assert "On c that is still 1.5 % off the smallest steps: within 1 % of these it" in said
    assert "it takes 40, 10 in each of 4 substeps." in said
    assert "On c more iterations do not help from some number on (distance from the same" in said
    assert "solved: 0.00107 with 10, 0.00110 with 40 in each of 4): that is no error of" in said
    assert "160 iterations take 26 s on c, its steps solved to convergence 5.0 s." in said


def test_cases_at_rest_say_nothing_of_substeps_and_what_is_round_off_is_not_drawn():
    rows = [setting(n, parts, error, error, case, time_step=None if case != "moving" else 1e-3)
            for case, errors in (("moving", (0.1, 0.01)), ("rest", (7.1e-8, 5.4e-8)))
            for (n, parts), error in zip(((8, 1), (2, 4)), errors, strict=True)]  # fmt: skip
    why = "RuntimeError: 'vbd': bin/python ended with 1: RuntimeError: does not converge"
    said = said_of(rows, {"apart": f"{why} (verify/a/program.py:66 in solve)"})[1]
    assert said.startswith("Substeps pay at equal work on the one case in motion. Error beside the")
    assert "1 at rest say nothing, where steps have no error of their own: rest." in said
    assert "1 left out: apart (does not converge)." in said
    for panels in (iterations_panels(rows, "whole_error"), substeps_panels(rows)):
        assert [panel.alt.split(":")[0] for panel in panels if panel] == ["moving"]
    said = said_of([row for row in rows if row["case"] == "rest"])[1]
    assert said.startswith("No case in motion has the same work with different substeps")


def test_ticks_are_the_numbers_that_were_tried():
    rows = [setting(n, 1, 0.1 / n, 0.1 / n) for n in (1, 2, 5, 40)]
    (panel,) = iterations_panels(rows, "whole_error")
    written = re.findall(r"<text[^>]*>([^<]*)</text>", panel.body)
    tried = [text for text in written if text in ("1", "2", "5", "10", "40", "100")]
    assert tried == ["1", "2", "5", "40"]


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

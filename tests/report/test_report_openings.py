"""Opening profiles of a case: reference and solvers in one figure, with the reference's band."""

import math
import re
from dataclasses import replace

import pytest
from synthetic_run import make_run

from verify.report.opening_section import opening_section
from verify.result import OpeningCurve, OpeningProfile, read_result, write_result

ARC = [0.0, 0.1, 0.2, 0.3]
WIDTH = [0.0, 0.002, 0.002, 0.0]


def curve(solver, level=1, scale=1.0, band=()):
    normal = [scale * v for v in (0.0, 0.01, -0.02, 0.0)]
    return OpeningCurve(solver, level, normal, [0.0] * 4, list(band), [0.0] * len(band))


def profile(*curves, time=None, why=""):
    points = [[s, 0.5] for s in ARC]
    return OpeningProfile("slit", "arc length along the cut", time, why, ARC, points, list(curves))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    root = make_run(tmp_path_factory.mktemp("openings") / "run", pictures=False)
    return read_result(root / "cases" / "statics__tissue_strip" / "result.json")


def drawn(result, *profiles):
    return opening_section(replace(result, openings=list(profiles)))


def test_reference_and_solvers_are_in_one_figure_with_the_band(result):
    page = drawn(result, profile(curve("reference", 2, band=WIDTH), curve("xfem"), curve("guest")))
    (panel,) = re.findall(r"<svg.*?</svg>", page, re.DOTALL)  # the tangential jump is zero
    assert panel.count('class="curve"') == 2 * 3  # a line and its sample for each
    assert panel.count('class="floor"') == 1
    # the band is as wide as stated: at the second point its edges are 0.004 m apart
    band = re.search(r'd="M([^"]*)Z" class="floor"', panel)[1]
    heights = [float(pair.split()[1]) for pair in band.split("L")]
    line = re.search(r'd="M([^"]*)" class="curve"', panel)[1]
    at = [float(pair.split()[1]) for pair in line.split("L")]
    per_metre = (at[2] - at[1]) / 0.03
    assert heights[1] - heights[-2] == pytest.approx(0.004 * per_metre, abs=0.2)
    assert "at most 0.002 m of the normal jump" in page


def test_an_exact_reference_is_named_so_and_has_no_uncertainty(result):
    page = drawn(result, profile(curve("reference", None, band=[0.0] * 4), curve("xfem")))
    assert ">exact<" in page
    assert "has no uncertainty" in page


def test_a_cut_that_stays_closed_is_said_in_words(result):
    page = drawn(result, profile(curve("reference", 2, 1e-16), curve("xfem", 1, 0.0)))
    assert "<svg" not in page
    assert "zero along the whole cut" in page


def test_no_solver_is_left_out_where_there_are_many_and_each_panel_has_the_reference(result):
    names = [f"solver{k}" for k in range(6)]
    page = drawn(result, profile(curve("reference", 2), *(curve(name) for name in names)))
    panels = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(panels) == 2
    assert all(">reference<" in panel for panel in panels)
    assert all(any(f">{name}<" in panel for panel in panels) for name in names)


def test_times_are_named_with_their_reason(result):
    page = drawn(result, profile(curve("xfem"), time=0.25, why="largest opening"))
    assert "slit, at 0.25 s (largest opening)" in page
    assert "no reference" in page


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_a_solver_that_blew_up_is_named_and_does_not_hide_the_others(result, value):
    odd = replace(curve("guest"), normal=[0.0, value, -value, 0.0])
    page = drawn(result, profile(curve("reference", 2), curve("xfem"), odd))
    (panel,) = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert panel == drawn(result, profile(curve("reference", 2), curve("xfem"))).partition(
        "</svg>")[0].partition("<svg")[2].join(["<svg", "</svg>"])  # fmt: skip
    assert "left out: guest" in page


def test_a_result_without_profiles_has_no_section(result):
    assert opening_section(result) is None


def test_profiles_are_read_as_they_were_written(result, tmp_path):
    whole = replace(result, openings=[profile(curve("reference", 2, band=WIDTH), time=0.5)])
    write_result(whole, tmp_path / "result.json")
    assert read_result(tmp_path / "result.json") == whole

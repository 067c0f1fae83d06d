"""Claims about the figures: what is drawn lies where its number says."""

import math
import re
from dataclasses import replace

import pytest
from synthetic_run import make_run

from verify.report import load_run
from verify.report.axes import Axis, Panel, log_range
from verify.report.case_section import _floor_text
from verify.report.curves import duration, error_curves, floor, limits
from verify.report.figures_convergence import convergence_figure, error_range, required_slope
from verify.report.marks import band, slope_triangle
from verify.result import Metric, SolveRecord, Status


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    run = load_run(make_run(tmp_path_factory.mktemp("figures") / "run", pictures=False))
    return {result.case: result for result in run.results}


def test_a_decade_is_as_long_anywhere_on_an_axis():
    axis = Axis(1e-6, 1e3, 10.0, 190.0)
    steps = [axis.at(10.0 ** (k + 1)) - axis.at(10.0**k) for k in range(-6, 3)]
    assert steps == pytest.approx([20.0] * 9, abs=1e-9)


@pytest.mark.parametrize(
    "span", [(1e-3, 2e-3), (0.9, 1.1), (1e-15, 1e-1), (4e-4, 7e-3), (5.0, 5.0)]
)
def test_every_axis_has_at_least_two_and_at_most_nine_labels_inside(span):
    low, high = log_range(list(span))
    labelled, _ = Axis(low, high, 0, 100).ticks()
    assert 2 <= len(labelled) <= 9
    assert all(low * 0.999 <= value <= high * 1.001 for value in labelled)


@pytest.mark.parametrize("ends", [(1e-3, 1e-1), (1e-1, 1e-3), (1e-2, 1e-2)])
def test_the_name_of_the_band_stands_below_its_edge(ends):
    panel = Panel((0.1, 10.0), (1e-4, 1.0), "h", "error")
    markup = str(band(panel, list(zip((0.2, 5.0), ends, strict=True))))
    x, y = (float(re.search(rf'<text[^>]* {k}="([0-9.]+)"', markup).group(1)) for k in "xy")
    # letters of 11 pixels: about 27 of half their size, 8 above the line they stand on
    reach = x - 27 * 5.0 if 'text-anchor="end"' in markup else x + 27 * 5.0

    def edge(pixel):
        share = (pixel - panel.x.at(0.2)) / (panel.x.at(5.0) - panel.x.at(0.2))
        share = min(max(share, 0.0), 1.0)
        return panel.y.at(ends[0] ** (1 - share) * ends[1] ** share)

    assert y - 8 >= max(edge(x), edge(reach))
    assert y <= panel.y.start


@pytest.mark.parametrize("slope", [0.5, 0.98, 1.95, 2.0])
def test_the_slope_triangle_has_its_slope(slope):
    panel = Panel((1e-3, 1.0), (1e-6, 1.0), "h", "e")
    drawn = slope_triangle(panel, 1e-2, 1e-1, 1e-4, slope, "")
    x0, y0, x1, y1 = map(float, re.search(r"M(\S+) (\S+)H(\S+)V(\S+)Z", drawn).groups())
    decade_x = panel.x.at(0.1) - panel.x.at(0.01)
    decade_y = panel.y.at(0.1) - panel.y.at(0.01)
    # pixels are written to a tenth
    assert ((y1 - y0) / decade_y) / ((x1 - x0) / decade_x) == pytest.approx(slope, abs=0.005)


def test_a_failed_level_ends_the_curve_and_is_marked(results):
    result = results["statics/griffith_inside"]
    curves = error_curves(result, "energy_norm")
    xfem = next(curve for curve in curves if curve.solver == "xfem")
    assert [len(stretch) for stretch in xfem.stretches] == [3]
    assert xfem.ends == [(3, "timeout")]
    figure = convergence_figure(result, "energy_norm", curves, error_range(curves, True), "error")
    assert figure.count('class="abandoned"') == 1
    assert "XFEM ended at level 3: timeout" in figure


def test_a_gap_in_the_levels_is_not_bridged(results):
    result = results["statics/f3_inclined"]
    solves = [
        SolveRecord(s.case, s.solver, s.level, Status.FAILED) if s.level == 1 else s
        for s in result.solves
    ]
    curve = error_curves(replace(result, solves=solves), "energy_norm")[0]
    assert [[p.level for p in stretch] for stretch in curve.stretches] == [[0], [2, 3]]


def test_a_quantity_is_drawn_by_its_deviation_from_the_stored_reference(results):
    result = results["statics/griffith_inside"]
    curve = next(c for c in error_curves(result, "strain_energy") if c.solver == "conforming")
    stored = [s.metric("strain_energy") for s in result.solves if s.solver == "conforming"]
    expected = [abs(m.value - m.reference) / m.reference for m in stored]
    assert [p.value for p in curve.points] == pytest.approx(expected, rel=1e-14)


def test_the_required_slope_is_that_of_the_case_and_no_other(results):
    assert required_slope(results["statics/f3_inclined"], "displacement_l2")[0] == 1.95
    assert required_slope(results["statics/griffith_inside"], "energy_norm") == (0.5, "0.5")
    assert required_slope(results["statics/tissue_strip"], "energy_norm") is None


def test_the_floor_of_the_reference_is_inside_the_figure_that_it_limits(results):
    result = results["statics/tissue_strip"]
    curves = error_curves(result, "energy_norm")
    low, high = error_range(curves, sloped=False)
    assert low < 0.03 / 2 < high
    figure = convergence_figure(result, "energy_norm", curves, (low, high), "error")
    assert figure.count('class="floor"') == 1
    edge = re.search(r'd="M(\S+) (\S+)L[^"]*" class="floor-edge"', figure)
    panel = Panel((1, 2), (low, high), "", "")
    assert float(edge[2]) == pytest.approx(panel.y.at(0.03), abs=0.06)


def test_the_band_and_its_caption_say_the_same_where_uncertainties_differ(results):
    """A solver far off is uncertain by more than all of another's error: no band over the other."""
    result = results["statics/f3_inclined"]
    levels = {"still": (1.0, 1e-3), "fine": (1e-4, 1e-6)}
    solves = [
        SolveRecord(
            "c", name, 0, Status.SOLVED, size=0.1, metrics=[Metric("energy_norm", e, "1", None, u)]
        )
        for name, (e, u) in levels.items()
    ]
    curves = error_curves(replace(result, solves=solves, rates=[]), "energy_norm")
    assert not any(limits(point) for curve in curves for point in curve.points)
    assert {u for _, u in floor(curves, lambda point: point.size)} == {1e-6}
    assert "below 1/30 of every error" in _floor_text(curves)


def test_an_exact_reference_draws_no_floor(results):
    result = results["statics/f3_inclined"]
    curves = error_curves(result, "energy_norm")
    figure = convergence_figure(result, "energy_norm", curves, error_range(curves, True), "error")
    assert "floor" not in figure


def test_time_is_added_repetition_by_repetition():
    timings = {"assembly": [1.0, 2.0, 9.0], "solve": [5.0, 1.0, 1.0], "meshing": [100.0]}
    time = duration(SolveRecord("c", "s", 0, Status.SOLVED, timings=timings))
    assert (time.low, time.median, time.high) == (3.0, 6.0, 10.0)
    assert time.meshing == 100.0
    assert time.phases == ("assembly", "solve")


def test_points_keep_clear_of_each_other_when_their_errors_do(results):
    curves = error_curves(results["statics/f3_inclined"], "displacement_l2")
    low, high = error_range(curves, sloped=True)
    values = [point.value for curve in curves for point in curve.points]
    assert low < min(values)
    assert max(values) < high
    assert math.log10(high / low) < 2 * math.log10(max(values) / min(values))

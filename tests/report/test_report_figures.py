"""Claims about the figures: what is drawn lies where its number says."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import make_run

from verify.report import load_run
from verify.report.case_view import floor_text, required_slope
from verify.report.curves import duration, error_curves, floor, limits
from verify.report.figures import convergence
from verify.report.figures.convergence import error_panel, error_range
from verify.report.figures.style import (
    Palette,
    drawing,
)
from verify.result import Metric, SolveRecord, Status


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    run = load_run(make_run(tmp_path_factory.mktemp("figures") / "run", pictures=False))
    return {result.case: result for result in run.results}


@pytest.fixture
def drawn(monkeypatch):
    """Return the axes of a convergence figure before it is SVG, with its description."""

    def of(result, metric, curves, y_range):
        kept = []

        def keep(figure, alt, kind="panel"):
            kept.append((figure.axes[0], alt))
            return drawing(figure, alt, kind)

        monkeypatch.setattr(convergence, "drawing", keep)
        slope = required_slope(result, metric)
        assert error_panel("error", curves, y_range, Palette(), slope=slope) is not None
        return kept[0]

    return of


def test_a_failed_level_ends_the_curve_and_is_marked(results, drawn):
    result = results["statics/griffith_inside"]
    curves = error_curves(result, "energy_norm")
    xfem = next(curve for curve in curves if curve.solver == "xfem")
    assert [len(stretch) for stretch in xfem.stretches] == [3]
    assert xfem.ends == [(3, "timeout")]
    axes, said = drawn(result, "energy_norm", curves, error_range(curves, True))
    crosses = [line.get_xydata() for line in axes.lines if line.get_marker() == "x"]
    assert [len(cross) for cross in crosses] == [1]
    assert crosses[0][0] == pytest.approx([0.125 / 8, xfem.points[-1].value])
    assert "XFEM ended at level 3: timeout" in said


def test_every_error_lies_where_its_number_says(results, drawn):
    result = results["statics/f3_inclined"]
    curves = error_curves(result, "energy_norm")
    axes, _ = drawn(result, "energy_norm", curves, error_range(curves, True))
    nodes = [line.get_xydata() for line in axes.lines if line.get_marker() in ("o", "s")]
    for curve, found in zip(curves, nodes, strict=True):
        expected = [(point.size, point.value) for point in curve.points]
        assert np.ravel(found) == pytest.approx(np.ravel(expected), rel=1e-14)


def test_a_quantity_is_drawn_by_its_deviation_from_the_stored_reference(results):
    result = results["statics/griffith_inside"]
    curve = next(c for c in error_curves(result, "strain_energy") if c.solver == "conforming")
    stored = [s.metric("strain_energy") for s in result.solves if s.solver == "conforming"]
    expected = [abs(m.value - m.reference) / m.reference for m in stored]
    assert [p.value for p in curve.points] == pytest.approx(expected, rel=1e-14)


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
    assert "below 1/30 of every error" in floor_text(curves)


def test_time_is_added_repetition_by_repetition():
    timings = {"assembly": [1.0, 2.0, 9.0], "solve": [5.0, 1.0, 1.0], "meshing": [100.0]}
    time = duration(SolveRecord("c", "s", 0, Status.SOLVED, timings=timings))
    assert (time.low, time.median, time.high) == (3.0, 6.0, 10.0)
    assert time.meshing == 100.0
    assert time.phases == ("assembly", "solve")

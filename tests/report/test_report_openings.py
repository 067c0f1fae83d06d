"""Opening profiles of a case: reference and solvers in one figure, with the reference's band."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import make_run

from verify.report.figures import profiles
from verify.report.figures.style import Palette, drawing
from verify.report.opening_view import opening_figures
from verify.result import OpeningCurve, OpeningProfile
from verify.result_files import read_result

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


@pytest.fixture
def drawn(result, monkeypatch):
    """Return the figures of some profiles, and of each panel what is drawn, before it is SVG."""

    def of(*shown):
        panels = []

        def keep(figure, alt, kind="panel"):
            (axes,) = figure.axes
            lines = {line.get_label(): line.get_xydata() for line in axes.lines}
            bands = [path.vertices for band in axes.collections for path in band.get_paths()]
            panels.append((lines, bands))
            return drawing(figure, alt, kind)

        monkeypatch.setattr(profiles, "drawing", keep)
        return opening_figures(replace(result, openings=list(shown)), Palette()), panels

    return of


def test_reference_and_solvers_are_in_one_figure_with_the_band(drawn):
    shown = profile(curve("reference", 2, band=WIDTH), curve("xfem"), curve("guest"))
    (figure,), ((lines, bands),) = drawn(shown)  # the tangential jump is zero
    assert list(lines) == ["reference", "XFEM", "guest"]
    assert lines["XFEM"][:, 0] == pytest.approx(ARC)
    assert lines["XFEM"][:, 1] == pytest.approx([0.0, 0.01, -0.02, 0.0])
    (band,) = bands
    at = band[np.isclose(band[:, 0], 0.1)]  # as wide as stated: 0.01 ± 0.002
    assert [at[:, 1].min(), at[:, 1].max()] == pytest.approx([0.008, 0.012])
    assert "at most 0.002 m of the normal jump" in figure.caption

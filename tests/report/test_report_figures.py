"""Figures: every error where its number says, motions, openings, outlines, error maps, notices.

And what holds for all: names inside, one solver one style, marks where something is cut off.
"""

import json
import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.textpath import TextPath
from page_parser import parsed
from synthetic_run import cut_square, make_run

from verify.report import error_plots, plots
from verify.report.bodies import Body, deformed_bodies
from verify.report.case_view import floor_text, required_slope
from verify.report.curves import error_curves, floor, limits
from verify.report.error_plots import error_panel, error_range, key
from verify.report.pictures import case_pictures, plane_tips
from verify.report.plots import Bar, Palette, Ranged, Series, bars, drawing, loglog, ranges
from verify.report.problem import cut_lines
from verify.report.profiles import opening_figures
from verify.report.rendering import Beside, render
from verify.report.run_directory import load_run
from verify.result import (
    Metric,
    Notice,
    NoticeKind,
    OpeningCurve,
    OpeningProfile,
    SolveRecord,
    Status,
    read_result,
    write_result,
)


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

        monkeypatch.setattr(error_plots, "drawing", keep)
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
    stored = [s.metric("strain_energy") for s in results["statics/griffith_inside"].solves
              if s.solver == "conforming"]  # fmt: skip
    found = error_curves(results["statics/griffith_inside"], "strain_energy")
    deviations = next([p.value for p in c.points] for c in found if c.solver == "conforming")
    assert deviations == pytest.approx([abs(m.value - m.reference) / m.reference for m in stored])
    for curve, found in zip(curves, nodes, strict=True):
        expected = [(point.size, point.value) for point in curve.points]
        assert np.ravel(found) == pytest.approx(np.ravel(expected), rel=1e-14)


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


TIMES = [0.0, 0.25, 0.5, 0.75, 1.0]


def moving_run(root, solvers=("xfem", "conforming"), opens_at=0.4):
    """Make the first case of a run move; every solver has its own energies."""
    make_run(root, False, "f3_inclined")
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    result = json.loads(file.read_text())
    model = max((s for s in result["solves"] if s["solver"] == "xfem"), key=lambda s: s["level"])
    result["solves"] = []
    for k, solver in enumerate(solvers):
        kinetic = [(k + 1) * t for t in TIMES]
        strain = [3.0 - value for value in kinetic]
        account = {"time": TIMES, "kinetic": kinetic, "strain": strain, "total": [3.0] * 5,
                   "algorithmic": [0.0] * 5, "linear_momentum_x": [3.0 * t for t in TIMES],
                   "linear_momentum_y": [4.0 * t for t in TIMES],
                   "angular_momentum_z": [-t for t in TIMES]}  # fmt: skip
        series = {"time": TIMES, "displacement_l2": [0.01 * (k + 1) * t for t in TIMES]}
        drift = {"name": "energy_drift", "value": 1e-3, "unit": "1", "reference": None,
                 "uncertainty": 0.0, "source": "ledger of the solution"}  # fmt: skip
        extra = {"solver": solver, "account": account, "series": series}
        result["solves"].append({**model, **extra, "metrics": [*model["metrics"], drift]})
    result["scene"]["cuts"] = [{"kind": "polyline", "opens_at": opens_at}]
    verdict = dict(result["verdicts"][0], metric="energy_drift", verdict="FAIL", limit="at most 0")
    result["verdicts"].append(verdict)
    file.write_text(json.dumps(result))
    return root


def panels(root):
    page = parsed(render(root).read_text(encoding="utf-8"))
    return page, [svg["aria-label"] for svg in page.all("svg") if svg.get("class") == "profile"]


def test_errors_energies_and_momenta_of_every_solver_are_drawn_over_time(tmp_path):
    _, labels = panels(moving_run(tmp_path / "run"))
    assert len(labels) == 6  # an error, kinetic and strain energy, the total, two momenta
    (kinetic,) = [text for text in labels if text.startswith("kinetic")]
    assert "XFEM: 0 to 1" in kinetic
    assert "conforming P1: 0 to 2" in kinetic
    assert not any("scheme" in text for text in labels)  # zero throughout
    (linear,) = [text for text in labels if "linear momentum" in text]
    assert "XFEM: 0 to 5" in linear  # |(3, 4)|
    (total,) = [text for text in labels if "change of the total" in text]
    assert "conforming P1: 0 to 0" in total


def test_an_error_below_the_uncertainty_of_its_reference_is_named_and_not_drawn(tmp_path):
    root = moving_run(tmp_path / "run")
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    result = json.loads(file.read_text())
    for solve, width in zip(result["solves"], (0.02, 1e-4), strict=True):  # errors 0.01 and 0.02
        largest = {"name": "displacement_l2_max", "value": max(solve["series"]["displacement_l2"]),
                   "unit": "1", "reference": None, "uncertainty": width, "source": ""}  # fmt: skip
        solve["metrics"].append(largest)
    file.write_text(json.dumps(result))
    page, labels = panels(root)
    (drawn,) = [text for text in labels if "L² error" in text]
    assert "conforming P1: 0 to 0.02" in drawn
    assert "XFEM" not in drawn
    assert "not above the uncertainty of the comparison: " in page.text


CLOSED = "its faces overlap by up to 18.5 mm at (0.05, 0.05) m"
NO_TIP = "the end of the arc (0.1, 0) m is no tip"


@pytest.fixture(scope="module")
def warned(tmp_path_factory):
    root = make_run(tmp_path_factory.mktemp("warned") / "run", False, "f3_inclined")
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
def openings_drawn(result, monkeypatch):
    """Return the figures of some profiles, and the curves of each panel before it is SVG."""

    def of(*shown):
        panels = []

        def keep(figure, alt, kind="panel"):
            (axes,) = figure.axes
            lines = {line.get_label(): line.get_xydata() for line in axes.lines}
            bands = [path.vertices for band in axes.collections for path in band.get_paths()]
            panels.append((lines, bands))
            return drawing(figure, alt, kind)

        monkeypatch.setattr(plots, "drawing", keep)
        return opening_figures(replace(result, openings=list(shown)), Palette()), panels

    return of


def test_reference_and_solvers_are_in_one_figure_with_the_band(openings_drawn):
    shown = profile(curve("reference", 2, band=WIDTH), curve("xfem"), curve("guest"))
    (figure,), ((lines, bands),) = openings_drawn(shown)  # the tangential jump is zero
    assert list(lines) == ["reference", "XFEM", "guest"]
    assert lines["XFEM"][:, 0] == pytest.approx(ARC)
    assert lines["XFEM"][:, 1] == pytest.approx([0.0, 0.01, -0.02, 0.0])
    (band,) = bands
    at = band[np.isclose(band[:, 0], 0.1)]  # as wide as stated: 0.01 ± 0.002
    assert [at[:, 1].min(), at[:, 1].max()] == pytest.approx([0.008, 0.012])
    assert "at most 0.002 m of the normal jump" in figure.caption


def test_pressures_of_faces_that_touch_are_a_panel_of_their_own(openings_drawn):
    pressed = replace(curve("reference", 2), pressure=[2.0, 1.0, 0.0, 0.0], pressure_band=[0.5] * 4)
    shut = replace(curve("xfem"), normal=[0.0] * 4, pressure=[3.0, 1.5, 0.0, 0.0])
    shown = profile(pressed, shut, curve("guest"))
    (figure,), ((lines, bands), _) = openings_drawn(shown)
    assert len(figure.panels) == 2
    assert list(lines) == ["reference", "XFEM"]  # a guest without contact states none
    assert lines["XFEM"][:, 1] == pytest.approx([3.0, 1.5, 0.0, 0.0])
    assert bands[0][:, 1].max() == pytest.approx(2.5)
    flat = replace(pressed, normal=[0.0] * 4)
    (figure,), _ = openings_drawn(profile(flat, shut))
    assert "zero along the whole cut" in figure.caption
    assert len(figure.panels) == 1


def lengths(body: Body) -> float:
    ends = body.points[body.edges]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())


@pytest.mark.parametrize("order", [1, 2])
def test_the_outline_is_the_boundary_with_both_faces_of_the_cut(order):
    body = deformed_bodies(cut_square(8, order), 0.0)[0]
    assert lengths(body) == pytest.approx(4 + 2 * np.hypot(1, 1 / 3), rel=1e-12)


def test_solutions_that_are_missing_damaged_or_elsewhere_become_notes(tmp_path):
    root = make_run(tmp_path / "run")
    folder = root / "cases" / "statics__f3_inclined"
    (folder / "xfem-3" / "solution.vtu").write_text("no mesh")
    (folder / "conforming-3" / "solution.json").unlink()
    for solver in ("xfem", "conforming"):
        (folder / f"error_field_{solver}.vtu").unlink()
    shown = case_pictures(root, load_run(root).entries[0])
    assert not shown.all
    # the rest of each sentence is from verify.solution
    for name in ("XFEM", "conforming P1"):
        assert f"No picture of {name}, level 3: " in " ".join(shown.notes)
    file = folder / "result.json"
    result = json.loads(file.read_text())
    for solve in result["solves"]:
        solve["solution"] = "../../secret/solution.json"
    result["pictures"] = {"error_field of xfem": "/etc/passwd"}
    file.write_text(json.dumps(result))
    shown = case_pictures(root, load_run(root).entries[0])
    assert not shown.all
    assert "directory" in shown.notes[0]


def test_the_lines_of_a_cut_are_itself_in_the_plane_and_its_rim_in_space():
    line = {"kind": "polyline", "points": [[0.2, 0.5], [0.6, 0.7]]}
    np.testing.assert_array_equal(cut_lines(line)[0], line["points"])
    arc = {"kind": "arc", "centre": [0.1, 0.2], "radius": 0.3, "start": 20.0, "sweep": 100.0}
    assert np.linalg.norm(cut_lines(arc)[0] - arc["centre"], axis=1) == pytest.approx(0.3)
    pipe = {"kind": "cylinder", "base": [0.0, 0.0, 0.1], "axis": [0.0, 0.0, 2.0], "radius": 0.3,
            "height": 0.5}  # fmt: skip
    (rims,) = cut_lines(pipe)
    x, y, z = rims[np.isfinite(rims).all(axis=1)].T
    assert np.hypot(x, y) == pytest.approx(0.3)
    assert set(z.round(12)) == {0.1, 0.6}
    assert cut_lines({"kind": "sphere", "centre": [0.0, 0.0, 0.0], "radius": 1.0}) == []
    # of a version that knew another kind
    assert len(cut_lines({"kind": "spline", "points": [[0.0, 0.0], [1.0, 1.0]]})[0]) == 2


def test_an_end_on_the_boundary_or_on_another_cut_is_no_tip():
    body = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
    cuts = [
        {"kind": "polyline", "name": "a", "points": [[0.0, 0.3], [0.5, 0.6]]},
        {"kind": "polyline", "name": "b", "points": [[0.25, 0.45], [0.2, 0.9]]},
        {"kind": "arc", "name": "c", "centre": [0.7, 0.2], "radius": 0.1},
    ]
    tips = plane_tips({"geometry": body, "cuts": cuts})
    np.testing.assert_allclose([end for end, _ in tips], [[0.5, 0.6], [0.2, 0.9]])
    assert [length for _, length in tips] == pytest.approx(
        [np.hypot(0.5, 0.3), np.hypot(0.05, 0.45)]
    )


SOLVERS = (
    "XFEM mass=consistent", "snapping_subdivision", "virtual_node_arbitrary weights=raised",
    "conforming P1 mesh=remeshed", "getfem tip=functions", "subdivision", "XFEM tip=inside",
    "virtual_node", "XFEM", "conforming P1",
)  # fmt: skip
TEXT = re.compile(
    r'<text style="font-size: (\d+)px([^"]*)"[^>]*'
    r"(?:translate\(|rotate\(\S+ )([-\d.]+) [^>]*>([^<]+)"
)


def curves(names):
    return loglog("error", "x", [Series(n, [(1.0, 1.0), (2.0, 3.0)]) for n in names], Palette())


@pytest.mark.parametrize("draw", [
    lambda: curves(SOLVERS),
    lambda: curves(SOLVERS[:4]),
    lambda: key(SOLVERS, Palette()),
    lambda: ranges("ratio", "x", [Ranged(f"{name} (= that of another)", 2.0) for name in SOLVERS],
                   Palette(), 1.0),
    lambda: bars("a title that is longer than the bars, their names and their numbers, and a word",
                 [Bar(name, 1.0, 0.0, "9 of 9") for name in SOLVERS], ""),
], ids=["legend", "named", "key", "ranges", "bars"])  # fmt: skip
def test_no_word_is_cut_off(draw):
    drawn = draw()
    found = TEXT.findall(drawn.body)
    assert len(found) >= 4
    assert len(found) == drawn.body.count("<text")
    for size, style, x, text in found:
        width = TextPath((0, 0), text, size=int(size)).get_extents().width
        left = float(x) - width * (0.5 * ("middle" in style) + ("end" in style))
        assert left >= -0.5, text
        assert left + width <= drawn.size[0] + 0.5, text


def test_solvers_look_the_same_in_every_figure_and_none_as_another():
    there, back = Palette.of(SOLVERS), Palette.of(reversed(SOLVERS))
    assert there == back
    assert there["virtual_node†*"] == there["virtual_node (= a program)"] == there["virtual_node"]
    styles = Palette.of([*SOLVERS, *(f"unknown {n}" for n in range(100))]).values()
    for one, other in combinations(styles, 2):
        assert (one.colour, one.marker) != (other.colour, other.marker)
        assert (one.colour, one.dashes) != (other.colour, other.dashes)


@pytest.fixture
def axes_of(monkeypatch):
    """Return the axes of a figure before it is SVG."""

    def of(plot, *given):
        kept = []
        monkeypatch.setattr(plots, "drawing", lambda figure, *_: kept.append(figure.axes[0]))
        plot(*given)
        return kept[0]

    return of


def test_a_range_has_an_arrow_head_where_it_goes_on_beyond_the_axis(axes_of):
    rows = [Ranged("whole", 2.0, 0.5, 8.0), Ranged("right", 1.0, 0.3, 80.0),
            Ranged("left", 1.0, 0.0, 3.0), Ranged("none", 1.0)]  # fmt: skip
    axes = axes_of(ranges, "ratio", "x", rows, Palette(), 1.0, (0.1, 10.0))
    heads = [line for line in axes.lines if line.get_marker() in ("<", ">")]
    left, right = axes.get_xlim()
    assert [(h.get_marker(), *map(float, np.ravel(h.get_xydata()))) for h in heads] == [
        (">", right, 1.0), ("<", left, 2.0),
    ]  # fmt: skip
    assert 0.05 < left < 0.1
    assert 10.0 < right < 20.0


def test_only_bars_with_an_interval_have_caps(axes_of):
    parts = [Bar("exact", 3.0, 0.0, ""), Bar("measured", 2.0, 0.25, "")]
    axes = axes_of(bars, "share", parts, "")
    caps = [x for line in axes.lines if line.get_marker() == "|" for x in line.get_xdata()]
    assert sorted(x for x in caps if np.isfinite(x)) == [1.75, 2.25]


def test_a_figure_beside_a_page_has_its_size_in_points(tmp_path):
    drawn = bars("share", [Bar("one", 1.0, 0.0, "")], "")
    width, height = drawn.size
    Beside(tmp_path / "pictures").drawing(drawn)
    head = (tmp_path / "pictures/001.svg").read_text("utf-8").partition(">")[0]
    assert f' width="{width:g}pt" height="{height:g}pt"' in head
    assert f' viewBox="0 0 {width:g} {height:g}"' in head

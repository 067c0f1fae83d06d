"""Claims about the plot of a reference's time to accuracy: what is drawn lies where it belongs."""

import numpy as np
import pytest

from verify.report.figures import studies
from verify.report.figures.accuracy import accuracy_figure

NORMS = ("displacement_l2", "energy_norm", "jump_l2", "displacement_max", "opening_l2")
QUANTITIES = ("strain_energy", "opening")


def levels_of(names, timed=(True, True, True)):
    """Make bounds that fall by 16 a level in four times the time."""
    return {
        f"level {k}": {"unknowns": 1000 * 4**k, "seconds": 0.25 * 4**k if timed[k] else None}
        | {name: 0.1 / (j + 1) / 16**k for j, name in enumerate(names)}
        for k in range(3)
    }


@pytest.fixture
def drawn(monkeypatch):
    """Return what is drawn, as a list of curves (label, nodes) per panel."""

    def of(levels):
        panels = []

        def keep(figure, alt, kind="panel"):
            (axes,) = figure.axes
            panels.append([line.get_xydata() for line in axes.lines])
            return alt

        monkeypatch.setattr(studies, "drawing", keep)
        return accuracy_figure(levels), panels

    return of


def test_every_bound_of_every_level_lies_where_its_number_says(drawn):
    levels = levels_of((*QUANTITIES, *NORMS))
    _, panels = drawn(levels)
    curves = [nodes for panel in panels for nodes in panel]
    bounds = [[levels[k][name] for k in levels] for name in (*QUANTITIES, *NORMS)]
    assert len(curves) == len(bounds)
    for row, nodes in zip(bounds, curves, strict=True):
        assert nodes[:, 0] == pytest.approx([0.25, 1.0, 4.0])
        assert nodes[:, 1] == pytest.approx(row)


def test_a_level_without_a_time_or_with_a_bound_of_zero_is_a_gap_and_not_bridged(drawn):
    _, (untimed,) = drawn(levels_of(QUANTITIES, (True, False, True)))
    for nodes in untimed:
        assert np.isnan(nodes).all(axis=1).tolist() == [False, True, False]
    exact = levels_of(("strain_energy",))
    exact["level 2"]["strain_energy"] = 0.0
    _, (panel,) = drawn(exact)
    assert [np.isfinite(nodes).all(axis=1).tolist() for nodes in panel] == [[True, True, False]]

"""Claims about the plot of a reference's time to accuracy: what is drawn lies where it belongs."""

import json
import math
import re

import pytest
from page_parser import parsed
from synthetic_run import make_run

from verify.report import render
from verify.report.axes import Panel, log_range
from verify.report.figures_reference import accuracy_figure

NORMS = ("displacement_l2", "energy_norm", "jump_l2", "displacement_max", "opening_l2")
QUANTITIES = ("strain_energy", "opening")


def levels_of(names, timed=(True, True, True)):
    """Make bounds that fall by 16 a level in four times the time."""
    return {
        f"level {k}": {"unknowns": 1000 * 4**k, "seconds": 0.25 * 4**k if timed[k] else None}
        | {name: 0.1 / (j + 1) / 16**k for j, name in enumerate(names)}
        for k in range(3)
    }


def nodes_of(figure):
    """Return the pixels of every curve."""
    paths = re.findall(r'd="M([^"]*)" class="curve"', str(figure))
    return [[tuple(map(float, node.split())) for node in path.split("L")] for path in paths]


def test_every_bound_of_every_level_lies_where_its_number_says():
    levels = levels_of((*QUANTITIES, *NORMS))
    figure = accuracy_figure(levels)
    bounds = [[levels[k][name] for k in levels] for name in (*QUANTITIES, *NORMS)]
    y_range = log_range([value for row in bounds for value in row])
    panel = Panel(log_range([0.25, 1.0, 4.0]), y_range, "", "")
    drawn = nodes_of(figure)
    assert len(drawn) == len(bounds)
    for row, nodes in zip(bounds, drawn, strict=True):
        expected = [(panel.x.at(0.25 * 4**k), panel.y.at(value)) for k, value in enumerate(row)]
        # pixels are written to a tenth
        assert [x for node in nodes for x in node] == pytest.approx(
            [x for node in expected for x in node], abs=0.051
        )


def test_quantities_and_norms_have_panels_of_their_own_with_four_curves_at_most():
    panels = str(accuracy_figure(levels_of((*NORMS, *QUANTITIES)))).split("</svg>")[:-1]
    assert [len(nodes_of(panel)) for panel in panels] == [2, 4, 1]
    assert [panel.count("level 1</text>") for panel in panels] == [1, 1, 1]


def test_a_level_without_a_time_or_with_a_bound_of_zero_is_a_gap_and_not_bridged():
    untimed = accuracy_figure(levels_of(QUANTITIES, (True, False, True)))
    assert [len(nodes) for nodes in nodes_of(untimed)] == [1] * 4
    exact = levels_of(("strain_energy",))
    exact["level 2"]["strain_energy"] = 0.0
    assert [len(nodes) for nodes in nodes_of(accuracy_figure(exact))] == [2]


@pytest.mark.parametrize(
    "levels",
    [
        {},
        levels_of(QUANTITIES, (False, False, False)),
        levels_of(()),
        {"level 0": {"unknowns": 3, "seconds": math.nan, "opening": math.inf}},
        {"level 0": {"unknowns": 3, "seconds": "soon", "opening": None}},
    ],
)
def test_without_a_time_or_a_bound_there_is_no_plot(levels):
    assert accuracy_figure(levels) is None


def test_the_page_has_the_plot_above_the_table_of_the_same_numbers(tmp_path):
    root = make_run(tmp_path / "run", pictures=False)
    file = root / "cases" / "statics__tissue_strip" / "result.json"
    result = json.loads(file.read_text())
    result["reference"]["time_to_accuracy"] = levels_of((*QUANTITIES, *NORMS))
    file.write_text(json.dumps(result))
    text = render(root).read_text(encoding="utf-8")
    said = [svg["aria-label"] for svg in parsed(text).all("svg")]
    said = [label for label in said if label.startswith("relative error of") and "bound" in label]
    assert len(said) == 1 + 2
    assert "opening: 0.05 in 250 ms to 0.000195 in 4 s." in said[0]
    plot = text.index("bounds of its relative errors against the wall time")
    assert plot < text.index("Reference: time to accuracy; of errors")

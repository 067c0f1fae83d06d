"""Frozen values of the benchmark: what the pages say, by two routes that agree, each held anew."""

import re
import subprocess
import sys
import tomllib
from math import hypot
from pathlib import Path

import pytest
import second_routes
from scenes import every_row

from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.judge.reference import exact_reference
from verify.result import read_result

ROOT = Path(__file__).resolve().parents[2]
VALUES = tomllib.loads((ROOT / "cases/benchmark/values.toml").read_text("utf-8"))
SCENES = {name: table for name, table in VALUES.items() if name != "version"}
# largest relative half-width of the second route (`dimension` of the scene, or "motion")
WIDEST = {2: 1e-4, 3: 5e-3, "motion": 1e-2}


def parsed(text):
    """Value and half-width of "1.25 ± 1e-3"; a closed form has no half-width."""
    value, _, half_width = text.partition(" ± ")
    return float(value), float(half_width or 0.0)


def page_of(scene):
    return (ROOT / f"docs/benchmark/{scene.split('_')[0]}.md").read_text("utf-8")


def size_of(name, values):
    """What a half-width is relative to: the value; of a factor, those of all modes together."""
    if not name.startswith("K_"):
        return parsed(values[name][0])[0]
    place = name.lstrip("K_").lstrip("I")
    modes = [f"K_{mode}{place}" for mode in ("I", "II", "III")]
    return hypot(*(parsed(values[mode][0])[0] for mode in modes if mode in values))


@pytest.mark.parametrize("scene", SCENES)
def test_both_routes_agree_and_are_as_narrow_as_asked(scene):
    loaded = every_row()[f"benchmark/{scene}"]
    kind = "motion" if loaded.analysis.kind == "dynamic" else loaded.dimension
    for name, (first, second) in SCENES[scene].items():
        (one, narrow), (two, wide) = parsed(first), parsed(second)
        assert abs(one - two) <= narrow + wide, name
        assert wide <= WIDEST[kind] * abs(size_of(name, SCENES[scene])), name


@pytest.mark.parametrize("scene", SCENES)
def test_the_page_states_the_values(scene):
    page, number = page_of(scene), scene.split("_")[0]
    assert f"Version {VALUES['version']}" in page
    rows = re.findall(
        r"^\| `([^`]+)` \| ([^|]*±[^|]*|-?[\d.]+) \| ([^|]*±[^|]*) \|$", page, re.MULTILINE
    )
    of_page = {name: table for name, table in SCENES.items() if name.startswith(f"{number}_")}
    assert rows == [
        (name if len(of_page) == 1 else f"{one}: {name}", *pair)
        for one, table in of_page.items()
        for name, pair in table.items()
    ]


@pytest.mark.fenicsx
@pytest.mark.parametrize("scene", [s for s in SCENES if every_row()[f"benchmark/{s}"].exact])
def test_closed_forms_are_those_of_the_judge(scene):
    from reference.exact import exact_of

    loaded = every_row()[f"benchmark/{scene}"]
    exact = exact_of(loaded)
    judged = exact_reference(loaded, exact, body_of(loaded), law_of(loaded)).quantities
    for name, (first, _) in SCENES[scene].items():
        stated, half_width = parsed(first)
        known = exact.energy_release_rate if name == "energy_taken" else judged[name][0]
        assert abs(known - stated) <= half_width, name


@pytest.mark.heavy
@pytest.mark.parametrize("scene", second_routes.SCENES)
def test_the_second_route_gives_what_is_stated(scene):
    """Half-widths, too; another version of scipy may triangulate otherwise."""
    for name, (value, half_width) in second_routes.second_route(scene).items():
        stated, wide = parsed(SCENES[scene][name][1])
        print(f"{name:24} {SCENES[scene][name][0]:24} {value:.9g} ± {half_width:.0e}")
        assert abs(value - stated) <= wide + half_width, name
        assert half_width <= 2 * wide, name


@pytest.mark.heavy
@pytest.mark.fenicsx
@pytest.mark.parametrize("scene", ["c1_slit", "c2_meeting", "c3_strip", "c4_disc"])
def test_solvers_are_off_by_what_the_page_says(scene, tmp_path):
    """Two digits of the errors in L2 and in the energy norm, level by level."""
    command = ["verify", "run", f"benchmark/{scene}", "--repetitions", "1", "--no-conform"]
    subprocess.run(
        [sys.executable, "-m", *command, "--no-report", "--out", str(tmp_path)], check=True
    )
    solves = read_result(next(tmp_path.glob("cases/*/result.json"))).solves
    row = r"^\| `(xfem|conforming)` \| ([^|]*) \| ([^|]*) \|"
    rows = re.findall(row, page_of(scene), flags=re.MULTILINE)
    assert len(rows) == 2
    for solver, *columns in rows:
        for metric, column in zip(("displacement_l2", "energy_norm"), columns, strict=True):
            found = [m.value for s in solves if s.solver == solver for m in s.metrics
                     if m.name == metric]  # fmt: skip
            assert found == pytest.approx([float(text) for text in column.split(",")], rel=0.06)

"""Whatever is written: on a full disk no half file stays, the file is named, the exit code is 3.

Each is written with ever more room until it fits, so that the disk is full at its first byte and
somewhere in the middle.
"""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_disk import by_command, in_this_process, named_until_it_fits, small_disk

from verify.compare.locate import SolutionField
from verify.reference_record import ReferenceRecord
from verify.report.blocks import Drawing
from verify.report.template_sets import PICTURES, Beside
from verify.result import CaseResult, write_result
from verify.runner.error_field import write_error_field
from verify.simulator import animation
from verify.simulator.anatomy.store import write_patch
from verify.simulator.stroke_file import write_stroke
from verify.solution import Solution, write_solution
from verify.xfem.cuts import ToolPath

NOISE = np.random.default_rng(1).integers(0, 256, (3, 96, 96, 3), dtype=np.uint8)
THESIS = Path(__file__).parent.parent / "cases" / "thesis"


@pytest.fixture
def disk(tmp_path):
    with small_disk(tmp_path / "disk", "2m") as disk:
        yield disk


def sheet(n=24):
    x = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    cells = np.vstack([np.c_[a, a + 1, a + n + 2], np.c_[a, a + n + 2, a + n + 1]])
    return Solution(points, cells, np.sin(points)[None])


def patch(path):
    rng = np.random.default_rng(2)
    write_patch(path, rng.random((90, 2)), [rng.random((9, 2))], rng.random((900, 3)))


def stroke(path):
    times = np.linspace(0.0, 1.0, 300)
    blades = np.zeros((300, 2, 3))
    blades[:, 0] = np.c_[times, times**2, 0 * times] / 3
    blades[:, 1] = blades[:, 0] + [0.0, 0.0, 0.1]
    write_stroke(ToolPath(blades, times), path)


WRITERS = {
    "solution.vtu": lambda path: write_solution(sheet(), path.with_suffix("")),
    "error_field.vtu": lambda path: write_error_field(sheet(), SolutionField(sheet(5)), path),
    "face.npz": patch,
    "stroke.toml": stroke,
    "a.gif": lambda path: animation.write_animation([], None, path, 10.0),
    "a.png": lambda path: animation.write_picture(None, None, path),
    "result.json": lambda path: write_result(
        CaseResult("a", "b" * 9000, "", "", {}, ReferenceRecord(), [], [], []), path
    ),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_does_not_fit_is_named_and_leaves_the_one_before(disk, monkeypatch, name):
    monkeypatch.setattr(animation, "_draw", lambda frames, view: list(NOISE))
    path = disk.root / name
    write = in_this_process(lambda: WRITERS[name](path))
    assert len(named := named_until_it_fits(disk, write)) >= 2
    assert set(named) <= {name, "solution.json"}
    before = path.read_bytes()
    disk.leave(0)
    assert write() is not None
    assert path.read_bytes() == before


def test_a_picture_of_the_markdown_report_that_does_not_fit_is_named(disk):
    made = io.BytesIO()
    Image.fromarray(NOISE[0]).save(made, "WEBP", quality=84)
    drawing = Drawing("<path/>" * 2000, (1.0, 1.0), "a")

    def written():
        assets = Beside(disk.root / PICTURES)
        assets.folder.mkdir(exist_ok=True)
        assets.drawing(drawing)
        assets.image(made.getvalue())

    write = in_this_process(written)
    named = named_until_it_fits(disk, write)
    assert set(named) == {f"{PICTURES}/001.svg", f"{PICTURES}/002.png"}


def test_an_export_that_does_not_fit_exits_with_3(disk, capsys):
    command = ("export", "statics/f1_patch", "--conforming", "--out", disk.root / "out")
    named = named_until_it_fits(disk, by_command(capsys, *command))
    assert "out/level-0/mesh.vtu" in named
    assert len(set(named)) >= 2


def test_an_animation_and_a_table_that_do_not_fit_exit_with_3(disk, capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(animation, "_draw", lambda frames, view: list(NOISE))
    case, table = THESIS / "tetrahedron_four_edges.toml", disk.root / "steps.csv"
    command = ("play", case, "--frames", "2", "--out", disk.root / "a.gif", "--records", table)
    named = named_until_it_fits(disk, by_command(capsys, *command))
    assert set(named) == {"a.gif", "steps.csv"}

"""Cases drawn while others are solved: the page is the one that `verify report` renders later."""

import os
import signal
from pathlib import Path

import pytest

from verify.errors import RunStoppedError
from verify.report import rendering
from verify.report.rendering import render
from verify.runner import comparing
from verify.runner.run import run_cases
from verify.runner.selection import Options
from verify.scene import load_scene


class Silent:
    def __getattr__(self, name):
        return lambda *arguments, **named: None


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Run two cases of which the second names a solver that the first has not."""
    folder = tmp_path_factory.mktemp("drawn")
    text = (Path(__file__).parents[2] / "cases/statics/f1_patch.toml").read_text()
    (folder / "one.toml").write_text(text)
    (folder / "two.toml").write_text(text.replace("title = ", "title = 'again' # ", 1))
    drawings = folder / "drawings"
    drawings.mkdir()
    scenes = [load_scene(folder / f"{name}.toml") for name in ("one", "two")]
    options = Options(solvers=("xfem", "conforming"), repetitions=1, jobs=2)
    run_cases(scenes, folder / "out", options, Silent(), drawings=drawings)
    return folder / "out", drawings


def test_every_judged_case_is_drawn_by_a_process_beside_and_the_page_is_the_same(
    drawn, monkeypatch
):
    run, drawings = drawn
    assert {file.stem for file in drawings.glob("*.pickle")} == {"one", "two"}
    alone = render(run).read_bytes()

    def not_again(*arguments):
        raise AssertionError("a case that is drawn was drawn again")

    monkeypatch.setattr(rendering, "drawn_case", not_again)
    assert render(run, drawings=drawings).read_bytes() == alone


def test_what_was_not_drawn_to_its_end_is_drawn_by_the_report(drawn, tmp_path):
    run, drawings = drawn
    alone = render(run).read_bytes()
    half = (drawings / "one.pickle").read_bytes()
    (tmp_path / "one.pickle").write_bytes(half[: len(half) // 2])
    assert render(run, drawings=tmp_path).read_bytes() == alone


def test_an_interrupted_run_leaves_no_drawing_process(tmp_path, drawn, monkeypatch):
    """The run is stopped as soon as a case is being drawn; all that it started ends with it."""
    started = []
    real = comparing.Child

    def child(module, *arguments, **named):
        started.append(real(module, *arguments, **named))
        os.kill(os.getpid(), signal.SIGTERM)  # SIGINT is ignored behind an `&`
        return started[-1]

    monkeypatch.setattr(comparing, "Child", child)
    source, _ = drawn
    scenes = [load_scene(source.parent / f"{name}.toml") for name in ("one", "two")]
    options = Options(solvers=("xfem", "conforming"), repetitions=1, jobs=2)
    with pytest.raises(RunStoppedError):
        run_cases(scenes, source, options, Silent(), drawings=tmp_path)
    assert started
    assert all(one.poll() is not None for one in started)

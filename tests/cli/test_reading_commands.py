"""Command lines that read: help, list, describe, completion, colours, waiting."""

import io
import json
import os
import re
import subprocess
import sys
import textwrap
import time

import pytest
from command_line import forking, run_here
from scenes import every_row, read_once

from verify.cli import build_parser, main, progress
from verify.cli.progress import Waiting, waiting_reported
from verify.cli.run import of_solvers
from verify.cli.streams import print_line, printable_streams
from verify.scene import list_cases

COMMANDS = ("list", "describe", "run", "report", "check", "schema")
SCENES = every_row()
# every fourth; of a family the row in which most tables with a condition stand, and the base
NAMES = [name for name in SCENES if "[" not in name or name.endswith(("=0.01]", "=0]"))][::4]
HEAVY = ("dolfinx", "gmsh", "pyvista", "vtk", "numba", "matplotlib", "scipy", "meshio", "petsc4py")


@pytest.mark.parametrize("command", [[], *[[name] for name in COMMANDS]])
def test_help_teaches_by_examples_that_parse(command, capsys):
    with pytest.raises(SystemExit) as leaving:
        main([*command, "--help"])
    assert leaving.value.code == 0
    text = capsys.readouterr().out
    examples = re.findall(r"^  verify (\S.*?)(?:   .*)?$", text.partition("examples:")[2], re.M)
    assert examples
    for example in examples:
        words = re.findall(r'"[^"]*"|\S+', example.partition(" > ")[0])
        build_parser().parse_args([word.strip('"') for word in words])


def test_list_names_every_case_with_its_title_and_wraps_at_the_width(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)  # what runs tests side by side sets it
    monkeypatch.setattr("verify.scene.load_scenes", read_once)  # of them are `SCENES`, too
    assert main(["list"]) == 0
    whole = capsys.readouterr().out
    assert [line.split()[0] for line in whole.splitlines()] == list(SCENES)
    monkeypatch.setenv("COLUMNS", "70")
    assert main(["list"]) == 0
    wrapped = capsys.readouterr().out
    assert max(map(len, wrapped.splitlines())) <= 70 < max(map(len, whole.splitlines()))
    assert wrapped.split() == whole.split()  # and no word is lost or broken
    assert main(["list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {row["name"]: row["title"] for row in rows} == {
        name: scene.title for name, scene in SCENES.items()
    }


@pytest.mark.parametrize("case", NAMES)
def test_describe_says_the_requirement_and_every_check(case, capsys, monkeypatch):
    """All defaults are written out, nothing is lost."""
    monkeypatch.setattr("verify.scene.load_scene", SCENES.__getitem__)
    assert main(["describe", case]) == 0
    text = " ".join(capsys.readouterr().out.split())
    scene = SCENES[case]
    assert scene.requirement in text
    for check in scene.acceptance:
        assert f"{check.metric} of {check.solver or 'each solver'}" in text
    assert main(["describe", case, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert type(scene).model_validate(content).model_dump() == scene.model_dump()


READING = """
import sys
def loaded():
    print("loaded", *sorted({name.partition(".")[0] for name in sys.modules}))
from verify.cli import main
loaded()
import verify.scene
first = dict(list(verify.scene.list_cases().items())[:3])
verify.scene.list_cases = lambda: first  # what reads three cases reads all
for words in (["list"], ["describe", "statics/f1_patch"], ["schema"]):
    main(words)
    loaded()
import verify.exchange  # what guests are built on
loaded()
"""


def test_reading_commands_load_no_solver_and_no_graphics_and_importing_them_nothing():
    command = [sys.executable, "-c", READING]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = [line.split() for line in done.stdout.splitlines() if line.startswith("loaded ")]
    assert len(said) == 5
    for loaded in said[:4]:
        assert set(loaded).isdisjoint(HEAVY)
    assert set(said[4]).isdisjoint(("matplotlib", "pyvista", "vtk"))
    assert set(said[0]).isdisjoint(("numpy", "pydantic", "rich"))


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        (["run", "--qu"], "--quick"),
        (["describe", "meeting/three"], "meeting/three_through_a_point"),
    ],
)
def test_bash_completes(capsys, tmp_path, words, completed):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "verify.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    typed = f"COMP_WORDS=(verify {' '.join(words)}); COMP_CWORD={len(words)}"
    asked = f'source {script}; {typed}; _shtab_verify; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(
        ["bash", "-c", asked], cwd=tmp_path, capture_output=True, text=True, timeout=30, check=True
    )
    assert done.stdout.split() == [completed]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def printed(monkeypatch, stream, line):
    monkeypatch.setattr(sys, "stdout", stream)
    with printable_streams():
        print_line(line)
    return stream.getvalue()


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def test_only_a_terminal_gets_colours_and_no_escapes_of_others(monkeypatch):
    assert "\x1b[32m" in printed(monkeypatch, Terminal(), "a  PASS")
    assert printed(monkeypatch, io.StringIO(), "a  PASS") == "a  PASS\n"
    assert "\x1b[2J" not in printed(monkeypatch, Terminal(), "a \x1b[2J PASS")


@pytest.mark.parametrize("name, value", [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_colours_can_be_refused(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    assert printed(monkeypatch, Terminal(), "a  PASS") == "a  PASS\n"


@pytest.mark.parametrize(
    "words, meant", [(["rnu"], "run"), (["list", "--jsno"], "--json"), (["solvers", "lst"], "list")]
)
def test_misspelt_commands_and_options_get_the_nearest(capsys, words, meant):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert f"'{meant}'" in capsys.readouterr().err


def test_each_solver_gets_its_own():
    """Numbers where they are JSON, and text elsewhere."""
    given = ["xfem.mass=evs", "xfem.a=0.5", "xfem.b=true", "my.module:Solver.order=2"]
    wanted = {"xfem": {"mass": "evs", "a": 0.5, "b": True}, "my.module:Solver": {"order": 2}}
    assert of_solvers(given) == wanted


def test_a_run_solves_with_the_parameters_that_it_was_given(tmp_path, capsys):
    # first order in time: after five steps a fifth further than the parabola
    text = list_cases()["dynamics/freed_half"].read_text(encoding="utf-8")
    for given, shorter in {
        "[[8, 8], [16, 16]]": "[[4, 4]]", "duration = 0.5": "duration = 0.05",
        "time = 0.3": "time = 0.03", "-1.225": "-0.01225", "-0.441": "-0.00441",
        "size = 0.15": "size = 0.6",  # both checks are against values
    }.items():  # fmt: skip
        assert given in text
        text = text.replace(given, shorter)
    (tmp_path / "falls.toml").write_text(text, encoding="utf-8")
    run = ["run", str(tmp_path / "falls.toml"), "--solver", "xfem", "--repetitions", "1"]
    out = ["--out", str(tmp_path / "run"), "--json", "--no-report"]
    assert main([*run, *out, "--set", "xfem.scheme=implicit_euler"]) != 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["verdict"] == "FAIL"
    found = {check["metric"]: check["observed"] for check in case["verdicts"]}
    assert found == pytest.approx({"fall": -0.01225 * 1.2, "fall_on_the_way": -0.00441 * 4 / 3})
    assert main(["run", "dynamics/freed_half", "--set", "xfme.scheme=newmark"]) == 2
    assert "no solver 'xfme'" in capsys.readouterr().err
    assert main(["run", "statics/f1_patch", "--set", "xfem.tip=middle", *out[:2]]) == 2
    assert "xfem.tip" in capsys.readouterr().err


SLOW = """
    import time
    class Slow:
        name = "slow"
        def refuses(self, scene):
            return None
        def levels(self, scene): return 1
        def solve(self, scene, level, repetitions=1):
            time.sleep(2)
            raise ValueError("nothing")
"""


def test_a_long_solve_says_through_a_pipe_what_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(progress, "_FIRST", 0.5)
    (tmp_path / "slow.py").write_text(textwrap.dedent(SLOW))
    monkeypatch.syspath_prepend(str(tmp_path))
    command = ["run", "statics/f1_patch", "--solver", "slow:Slow", "--out", "out", "--no-report"]
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    with forking("slow:Slow".__eq__):
        done = run_here([*command, "--quick", "--judge", "slow:Slow"], tmp_path, paths)
    waits = [line for line in done.stderr.splitlines() if line.startswith("…")]
    of_solve = [line for line in waits if "statics/f1_patch · slow:Slow · level 0" in line]
    assert len(of_solve) >= 2  # after 0.5 s and after 1.5 s
    assert len(of_solve) < 5
    assert "\r" not in done.stderr
    assert "\x1b" not in done.stderr


def test_after_a_word_the_next_silence_is_as_short_as_the_first(monkeypatch):
    monkeypatch.setattr(progress, "_FIRST", 0.03)
    said = io.StringIO()
    waiting = Waiting(said, lambda: "something")

    def until(lines, seconds):
        end = time.monotonic() + seconds
        while said.getvalue().count("…") < lines and time.monotonic() < end:
            time.sleep(0.01)
        return said.getvalue().count("…") == lines

    try:
        assert until(5, 60.0)  # and the sixth after 0.96 s more
        waiting.say("a word")
        assert until(6, 0.6)
    finally:
        waiting.close()


def test_nothing_is_said_of_what_is_soon_done(capsys):
    with waiting_reported(sys.stderr, "a little thing"):
        time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_solvers_without_a_word_are_listed(capsys):
    assert main(["solvers"]) == 0
    listed = capsys.readouterr().out
    assert main(["solvers", "list"]) == 0
    assert capsys.readouterr().out == listed
    assert listed.startswith("of the project, and plugged in: ")
    assert "xfem" in listed

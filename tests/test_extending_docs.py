"""The pages on extending and on regression are run: every file, every command, in order."""

import os
import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec

import pytest
from doc_pages import DOCS, ROOT, blocks, commands, run_line

pytest_plugins = ["pytester"]
needs_skfem = pytest.mark.skipif(find_spec("skfem") is None, reason="needs scikit-fem")


@pytest.fixture
def examples(tmp_path):
    """A folder with the example files of the page."""
    for file in [*(DOCS / "examples").glob("*.py"), DOCS / "examples/square.toml"]:
        (tmp_path / file.name).write_text(file.read_text())
    return tmp_path


def test_the_page_shows_the_example_files_as_they_are():
    shown = set(blocks("guide/your-solver.md", "python"))
    files = {file.name: file.read_text() for file in (DOCS / "examples").glob("*.py")}
    assert set(files.values()) == shown
    case = blocks("guide/your-solver.md", "toml")[0]
    assert (DOCS / "examples/square.toml").read_text() == case


@needs_skfem
def test_every_command_on_extending_succeeds_in_order(examples):
    said = {}
    for line in commands("guide/your-solver.md"):
        done = run_line(line, examples)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        said[line.split()[1]] = done.stdout
    # the example solver keeps what it does not refuse, and its metric is round-off
    assert re.search(r"^cut-patch +pass", said["conform"], re.MULTILINE)
    strain = re.findall(r"(\S+): (\S+) ± ", said["strain_error.py"])
    assert {name.rpartition("-")[0] for name, _ in strain} == {"skfem_solver_SkfemSolver", "xfem"}
    assert all(float(value) < 1e-12 for _, value in strain)
    assert "1 PASS" in said["import"]


def register(folder, table):
    """Install the entry points of a TOML table from a folder that is on the path."""
    points = tomllib.loads(table)["project"]["entry-points"]
    (group,) = points
    (folder / "own-1.0.dist-info").mkdir()
    (folder / "own-1.0.dist-info/METADATA").write_text("Name: own\nVersion: 1.0\n")
    lines = [f"[{group}]", *(f"{name} = {value}" for name, value in points[group].items())]
    (folder / "own-1.0.dist-info/entry_points.txt").write_text("\n".join(lines))


OWN_FIELD = """
title = "In-plane bending, uncut"
requirement = "The energy shall be that of the exact solution of the user's own."
[geometry]
kind = "rectangle"
lower = [0.0, 0.0]
upper = [2.0, 1.0]
[mesh]
cells = [[8, 4], [16, 8], [32, 16]]
[material]
young = 2.0
poisson = 0.3
plane = "strain"
[[supports]]
where = "boundary"
displacement = "exact"
[exact]
solution = "stretched_plate"
parameters = { stress_gradient = 3.0 }
[[acceptance]]
check = "rate"
metric = "energy_norm"
equals = 1.0
within = 0.1
"""


# in a process that finds the packages installed in its folder; its own are forked from it
INSTALLED = """
from verify.cli import main
for words in {lines}:
    print("exit code", main(words.split()[1:]), flush=True)
"""


def test_the_entry_point_of_the_page_makes_an_exact_solution_a_case_can_name(examples):
    (examples / "bending.toml").write_text(OWN_FIELD)
    unknown = run_line("verify check bending.toml", examples)
    assert unknown.returncode == 2
    assert "stretched_plate" in unknown.stderr
    register(examples, blocks("guide/your-solver.md", "toml")[-1])
    (examples / "slope.toml").write_text(OWN_FIELD.replace("stress_gradient", "slope"))
    # quadratic in x and y: P1 errs with order 1 in the energy norm
    lines = ["verify list --exact", "verify check slope.toml",
             "verify run bending.toml --solver xfem --out run --repetitions 1"]  # fmt: skip
    paths = os.pathsep.join([str(examples), str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", INSTALLED.format(lines=lines)], cwd=examples,
        env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    listed, *rest = done.stdout.split("exit code ")
    assert "stretched_plate" in listed
    assert [part[0] for part in rest] == ["0", "2", "0"], done.stdout + done.stderr
    assert "stretched_plate" in done.stderr  # which has no slope


def test_every_command_on_regression_succeeds_in_order(tmp_path):
    for line in commands("guide/regression.md"):
        done = run_line(line, tmp_path)
        # undecided verdicts on speed depend on the machine: the page says so
        allowed = (0, 5) if "--strict" in line else (0, 1) if " check " in line else (0,)
        assert done.returncode in allowed, f"{line}\n{done.stdout}\n{done.stderr}"
        assert not re.search("^FAIL +(own|independent|reference)", done.stdout, re.MULTILINE)
        if "--only" in line:
            assert "1 own values moved" in done.stdout

"""Commands that only read: quick, complete, and honest about what they do not know."""

import json
import os
import re
import statistics
import subprocess
import sys

import pytest

from verify.cli import main
from verify.cli.parser import build_parser
from verify.scene import list_cases, load_scene, load_scenes

COMMANDS = ("list", "describe", "run", "report", "check", "schema")
SCENES = {scene.name: scene for path in list_cases().values() for scene in load_scenes(path)}
# of a family the row in which most tables with a condition stand, and the base
NAMES = [name for name in SCENES if "[" not in name or name.endswith(("=0.01]", "=0]"))]
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


def test_list_names_every_case_with_its_title(capsys):
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(SCENES)
    assert main(["list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {row["name"]: row["title"] for row in rows} == {
        name: scene.title for name, scene in SCENES.items()
    }


@pytest.mark.parametrize("case", NAMES)
def test_describe_says_the_requirement_and_every_check(case, capsys):
    assert main(["describe", case]) == 0
    text = " ".join(capsys.readouterr().out.split())
    scene = load_scene(case)
    assert scene.requirement in text
    for check in scene.acceptance:
        assert f"{check.metric} of {check.solver or 'each solver'}" in text
    assert main(["describe", case, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    # all defaults are written out, nothing is lost
    assert type(scene).model_validate(content).model_dump() == scene.model_dump()


def loaded_by(code):
    probe = f"{code}\nimport sys; print(*sorted({{n.partition('.')[0] for n in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "code",
    [
        "import verify.cli",
        "from verify.cli import main; main(['list'])",
        "from verify.cli import main; main(['describe', 'statics/f1_patch'])",
        "from verify.cli import main; main(['schema'])",
    ],
)
def test_reading_commands_load_no_solver_and_no_graphics(code):
    assert loaded_by(code).isdisjoint(HEAVY)


def test_importing_the_command_line_loads_nothing_but_the_standard_library():
    assert loaded_by("import verify.cli").isdisjoint(("numpy", "pydantic", "rich", *HEAVY))


@pytest.mark.timing
def test_list_takes_little_more_than_reading_all_case_files():
    """In processor time: 1.04 was seen (0.9 to 1.2); numba and one solver would add a half."""

    def seconds(*command):
        before = os.times()
        subprocess.run([sys.executable, *command], capture_output=True, check=True)
        after = os.times()
        return sum(after[2:4]) - sum(before[2:4])

    reading = (
        "from verify.scene import list_cases, load_scenes\n"
        "for path in list_cases().values(): load_scenes(path)"
    )
    ratios = [seconds("-m", "verify", "list") / seconds("-c", reading) for _ in range(5)]
    assert statistics.median(ratios) < 1.5

"""The documentation is run: every command in it, on the case that it teaches to write."""

import re
import shlex
import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from doc_pages import DOCS, ROOT, blocks, commands, run_line
from scenes import read_once

from verify.cli import build_parser
from verify.foreign import foreign_solver, state_of

PAGES = ["guide/write-a-case.md", "guide/cli.md"]
ELSEWHERE = {"verify doctor"}  # what it finds is held in tests/install


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_the_page_succeeds(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("verify.scene.load_scenes", read_once)
    case = blocks("guide/write-a-case.md", "toml")[0]
    # coarse meshes, and a reference far better than the 20 % that are asked
    assert "[[48, 16], [96, 32], [192, 64]]" in case
    case = case.replace("[[48, 16], [96, 32], [192, 64]]", "[[36, 12], [72, 24]]")
    case += "[reference]\nsize = 0.01\n"
    (tmp_path / "my_case.toml").write_text(case, encoding="utf-8")
    lines = commands(page)
    assert len(lines) >= 3
    for line in [line for line in lines if line not in ELSEWHERE]:
        done = run_line(line, tmp_path)
        # cli.md runs the example without its reference: its verdicts stay undecided, code 0
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def code_in(text: str) -> list[str]:
    return re.findall(r"^```[^\n]*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands_of(page: Path) -> Iterator[tuple[str, bool]]:
    """Commands of the project on a page, and whether they stand in a block of shell commands."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    own = r"(?:verify|make|python|\.ci/\w+)"
    if page.suffix == ".yml":
        for line in re.findall(r"^ +run: (verify .*)$", text, flags=re.MULTILINE):
            yield line, False
        return
    for language, block in re.findall(r"^```([^\n]*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for line in re.findall(rf"^(?:[!$] ?)?({own}(?: .*)?)$", block, flags=re.MULTILINE):
            yield " ".join(re.sub(r"\s# .*", "", line).split()), language in SHELL
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    for line in re.findall(r"`((?:verify |make |\.ci/)\w[^`]*)`", prose):
        yield " ".join(line.split()), False


def all_commands() -> Iterator[tuple[str, str, bool]]:
    """Page, command, and whether it stands in a block of shell commands."""
    pages = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "action.yml")),
             *sorted(DOCS.rglob("*.md"))]  # fmt: skip
    for page in pages:
        for command, in_block in commands_of(page):
            yield page.relative_to(ROOT).as_posix(), command, in_block


SHELL = ("sh", "console")
HERE, FOREIGN = "tests/cli/test_docs.py", "tests/foreign/test_installing.py"
# by test: pages of which it runs every command in a block, one after the other, and first words of
# commands; a command whose case is not in the docs is run with another one
RUN_BY = {
    f"{HERE}::test_every_command_of_the_page_succeeds": [
        "docs/guide/write-a-case.md", "docs/guide/cli.md", "verify list", "verify schema",
        "verify check my_", "verify run my_", "verify solvers list"],
    "tests/test_extending_docs.py::test_every_command_on_extending_succeeds_in_order": [
        "docs/guide/your-solver.md"],
    "tests/test_extending_docs.py::test_every_command_on_regression_succeeds_in_order": [
        "docs/guide/regression.md", "verify baseline check"],
    "tests/simulator/test_thesis_guide.py::test_every_command_of_the_guide_succeeds": [
        "docs/guide/simulator.md", "verify play"],
    "tests/cli/test_tutorial.py"
    "::test_every_cell_of_the_notebook_runs_and_the_wrong_solver_alone_fails": [
        "docs/guide/tutorial.md"],
    "tests/runner/test_cluster.py::test_a_killed_worker_loses_nothing": [
        "verify run -k not quick --out sweep --cluster",
        "verify run -k quick --solver xfem --solver removal"],
    "tests/runner/test_reference_cache.py"
    "::test_a_run_judges_by_a_bundle_where_fenicsx_is_not_installed": [
        "verify cache export", "verify run statics/tissue_strip --solver xfem --references"],
    f"{FOREIGN}"
    "::test_a_solver_is_installed_with_its_hash_into_an_environment_of_its_own_and_removed": [
        "verify solvers install", "verify solvers remove"],
    "tests/foreign/test_live.py::test_an_installed_solver_keeps_what_it_does_not_refuse": [
        "verify conform ngsxfem"],
    "tests/foreign/test_live.py::test_an_installed_solver_passes_the_patch_test": [
        "verify run statics/f3_inclined --solver xfem --solver ngsxfem"],
    "tests/foreign/test_programs.py"
    "::test_the_template_answers_a_case_where_verify_cannot_be_imported": [
        "verify export statics/f1_patch --out mine", "python mine/example.py",
        "verify import statics/f1_patch mine"],
    "tests/install/test_setup.py::test_all_that_a_full_run_needs_works_here": ["verify doctor"],
    "tests/install/test_setup.py::test_setup_installs_the_hashed_lock_and_then_the_project": [
        ".ci/setup"],
    "tests/install/test_setup.py::test_no_claim_about_time_decides_make_test": [
        "make test", "make bench"],
    f"{HERE}::test_make_knows_its_targets": ["make"],
    f"{HERE}::test_scripts_are_there_and_compile": [".ci/"],
    f"{HERE}::test_a_command_of_seconds_succeeds": [
        "verify conform virtual_node", "verify conform snapping"],
    f"{HERE}::test_a_command_of_minutes_succeeds": [
        "verify run --quick --solver my_solver", "verify study",
        "verify run cutting/hanging_block_quick", "verify run dynamics/freed_half"],
    "tests/install/test_light_judge.py"
    "::test_an_environment_of_pip_install_is_small_and_judges_the_benchmark": [
        "verify export benchmark", "verify import benchmark", "verify run benchmark --solver"],
    "tests/benchmark/test_values.py::test_solvers_are_off_by_what_the_page_says": [
        "verify run benchmark/"],
}  # fmt: skip
BY_NAME = {name: test for test, names in RUN_BY.items() for name in names}
# written by `make results` beside what came of it
RESULTS = "docs/results/"
# of the form of a command: a word in capitals or three dots stand for something
FORM = re.compile(r"\b[A-Z]{3,}\b|…|\$\{\{| --help$")


def runner_of(page: str, command: str, in_block: bool) -> str:
    """The test that runs a command; empty if nobody does."""
    if page.startswith(RESULTS) or FORM.search(command):
        return "tests/cli/test_docs.py::test_every_command_in_the_docs_parses"
    if re.match(r"verify [a-z]+( [a-z]+| --\w+)?$", command) and not in_block:
        return "tests/cli/test_docs.py::test_every_command_in_the_docs_parses"
    plain = command.replace('"', "")
    name = max((start for start in BY_NAME if plain.startswith(start)), key=len, default="")
    return BY_NAME.get(page if in_block and page in BY_NAME else name, "")


def test_every_command_in_the_docs_is_run_by_a_test() -> None:
    found = {one: runner_of(*one) for one in all_commands()}
    assert len(found) > 100
    assert [one[:2] for one, test in found.items() if not test] == []
    for test in sorted({*found.values(), *RUN_BY}):
        file, _, name = test.partition("::")
        assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8"), test
    used = [command.replace('"', "") for _, command, _ in found]
    starts = [name for name in BY_NAME if not name.startswith("docs/")]
    assert [start for start in starts if not any(c.startswith(start) for c in used)] == []


def test_a_command_that_nobody_runs_is_noticed() -> None:
    assert not runner_of("README.md", "verify run statics/f1_patch --out somewhere", True)
    assert not runner_of("docs/guide/cli.md", "verify paraview patch --level 1", False)


def test_make_knows_its_targets() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    asked = {command.split()[1] for _, command, _ in all_commands() if command.startswith("make ")}
    for target in asked:
        assert re.search(rf"^{target}:.*## ", makefile, flags=re.MULTILINE), target


def test_scripts_are_there_and_compile() -> None:
    asked = {command.split()[0] for _, command, _ in all_commands() if command.startswith(".ci/")}
    for name in asked:
        file = ROOT / name
        assert file.exists(), name
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        if text.startswith("#!/usr/bin/env python"):
            compile(text, name, "exec")


@pytest.mark.parametrize("command", [
    "verify conform virtual_node --check cut-patch --check free-piece",
    "verify conform snapping_subdivision --set threshold=0.3 --check cut-patch",
])  # fmt: skip
def test_a_command_of_seconds_succeeds(command: str, tmp_path: Path) -> None:
    assert command in [line for _, line, _ in all_commands()]
    done = run_line(command, tmp_path)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


def long_commands() -> list[str]:
    """Studies and runs that only this file runs, as they stand in the docs."""
    own = "tests/cli/test_docs.py::test_a_command_of_minutes_succeeds"
    every = {one[1]: runner_of(*one) for one in all_commands()}
    return [line for line, test in every.items() if test == own]


@pytest.mark.heavy
@pytest.mark.parametrize("command", long_commands())
def test_a_command_of_minutes_succeeds(command: str, tmp_path: Path) -> None:
    if "vbd" in command and not state_of(foreign_solver("vbd")).python:
        pytest.skip("vbd is not installed")
    if "my_solver" in command and find_spec("skfem") is None:
        pytest.skip("scikit-fem is not installed")
    shutil.copytree(DOCS / "examples", tmp_path / "docs/examples")
    shutil.copy(DOCS / "examples/skfem_solver.py", tmp_path / "my_solver.py")
    done = run_line(command, tmp_path)
    # the thesis' mass fails what it fails, as the page says
    allowed = (1,) if "xfem.mass=thesis" in command else (0,)
    assert done.returncode in allowed, f"{done.stdout}\n{done.stderr}"


def test_every_command_in_the_docs_parses() -> None:
    pages = [DOCS.parent / "README.md", *DOCS.rglob("*.md"), *DOCS.rglob("*.py")]
    text = "\n".join(page.read_text("utf-8") for page in pages).replace("\\\n", " ")
    lines = re.findall(r"^(?:[!$] ?)?(verify .+)$", "\n".join(code_in(text)), flags=re.MULTILINE)
    assert len(lines) > 50
    parser = build_parser()
    for line in lines:
        words = shlex.split(re.split(r" [>|&] | &&", line)[0], comments=True)
        assert parser.parse_args(words[1:]).command, line

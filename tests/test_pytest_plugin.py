"""The plugin, in pytest sessions of its own: a test per acceptance check of a case."""

import os
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from case_texts import STRETCHED, body_text

ROOT = Path(__file__).resolve().parents[1]
pytest_plugins = ["pytester"]

CASE = (
    body_text("A strained square", "It shall be strained.", [1.0, 1.0], [[2, 2]], poisson="0.0")
    + STRETCHED
)


def check(equals, solver=None):
    named = "" if solver is None else f'solver = "{solver}"'
    return f"""
[[acceptance]]
check = "value"
{named}
metric = "strain_energy"
equals = {equals}
relative_tolerance = 1e-9
source = "half of E times strain squared"
"""


# a slope over one level means nothing: undecided
RATIO = """
[[acceptance]]
check = "ratio"
metric = "displacement_l2"
to = "xfem"
at_most = 1.0
"""


KNOWN = """
[[known_findings]]
solver = "conforming"
check = "value"
metric = "strain_energy"
reason = "the second check is wrong"
"""


@pytest.fixture
def session(pytester, monkeypatch):
    """Run a session of its own on files made here; the cases run in processes of their own."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    installed = {point.value for point in entry_points(group="pytest11")}
    plugin = [] if "verify.pytest_plugin" in installed else ["-p", "verify.pytest_plugin"]

    def run(*arguments):
        return pytester.runpytest_inprocess(
            *plugin, "-p", "no:cacheprovider", "-p", "no:xdist", "-rs", *arguments
        )

    return run


def write(pytester, text):
    (pytester.path / "strain.verify.toml").write_text(text)


def test_each_acceptance_check_of_a_case_file_is_a_test_that_passes_or_fails(pytester, session):
    checks = check(0.005) + check(0.006) + RATIO + KNOWN
    pytester.makeini("[pytest]\nverify_solvers = xfem conforming reference")
    write(pytester, CASE + checks)
    pytester.makefile(".toml", not_a_case="a = 1")
    result = session("-v", "--verify-out", "runs")
    result.assert_outcomes(passed=2, failed=1, xfailed=1, skipped=1)
    result.stdout.fnmatch_lines(
        [
            "*strain.verify.toml::value-strain_energy-xfem PASSED*",
            "*strain.verify.toml::value-strain_energy-conforming PASSED*",
            "*strain.verify.toml::value-strain_energy-xfem-#2 FAILED*",
            "*strain.verify.toml::value-strain_energy-conforming-#2 XFAIL*",
            "*strain.verify.toml::ratio-displacement_l2-conforming SKIPPED*",
            "FAIL: strain_energy (xfem): 0.005, wanted 0.006 ± 1e-09 (relative)*",
            "SKIPPED*UNDECIDED: displacement_l2*round-off*",
        ]
    )
    assert (pytester.path / "runs/strain.verify/run.json").is_file()
    # finished solves are reused; strict: an undecided verdict fails
    strict = session("--verify-strict", "--verify-out", "runs")
    strict.assert_outcomes(passed=2, failed=2, xfailed=1)


def test_a_marked_function_is_a_test_per_check_and_its_body_sees_the_result(pytester, session):
    pytester.makefile(".toml", strain=CASE + check(0.005) + check(0.006))
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.verify("strain.toml")
        def test_strain():
            pass

        @pytest.mark.verify("strain.toml")
        def test_body(verify_check, verify_result):
            assert verify_check.observed == pytest.approx(0.005)
            assert verify_result.solves[0].unknowns == 18
            raise AssertionError("the body ran")

        def test_plain():
            pass
        """
    )
    result = session("-v")
    result.assert_outcomes(passed=2, failed=3)
    result.stdout.fnmatch_lines(
        [
            "*::test_strain[[]value-strain_energy-xfem] PASSED*",
            "*::test_strain[[]value-strain_energy-xfem-#2] FAILED*",
            "*AssertionError: the body ran*",
        ]
    )
    assert str(result.stdout).count("E       AssertionError: the body ran") == 1


def test_a_bad_case_file_is_an_error_of_collection_in_one_line(pytester, session):
    write(pytester, CASE.replace("young", "yuong"))
    pytester.makepyfile("def test_plain(): pass")
    result = session()
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["*strain.verify.toml: material.yuong: unknown key; did you mean 'young'?*"]
    )
    marked = '@__import__("pytest").mark.verify("statics/f1_pach")\ndef test_it(): pass'
    pytester.makepyfile(test_marked=marked)
    result = session("test_marked.py")
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*no case 'statics/f1_pach'; did you mean 'statics/f1_patch'?*"])
    result.stdout.no_fnmatch_line("*pytest_generate_tests*")  # one line, no traceback

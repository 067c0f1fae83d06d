"""Commands for solvers of others: their files, their answers, what they must keep to."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from verify.cli.signatures import Arg, Cases, Jobs, Out, Repetitions, Strict, Timeout
from verify.cli.streams import command_line, print_answer

if TYPE_CHECKING:
    from verify.conformance import CheckResult


def export(
    case: Cases,
    *,
    out: Out,
    levels: Annotated[Sequence[int], Arg("K", ("--level",))] = (),
    conforming: bool = False,
    template: Literal["python"] | None = None,
    as_json: Annotated[bool, Arg(flags=("--json",))] = False,
) -> int:
    """Write a case as files for another program: meshes, cuts, supports, loads.

    Parameters
    ----------
    levels
        only this mesh level, 0 is the coarsest; repeat for several (default: all)
    conforming
        also write meshes that conform to the cuts, with their nodes doubled
    template
        also write a program that answers the case, on a reader and writer that need numpy alone
        (with --conforming)
    as_json
        print the files as JSON

    Examples
    --------
      verify export statics/f3_inclined --out f3
      verify export my_case.toml --out mine --level 0 --conforming
      verify export statics/f3_inclined --out f3 --template python

    The program answers in f3/level-<k>/solution.json and .vtu;
    see docs/guide/your-solver.md.
    """  # fmt: skip
    from verify.exchange import export_case
    from verify.foreign.installing import write_template
    from verify.runner.selection import select_cases

    scenes = select_cases([case], weight="heavy")
    files = []
    for scene in scenes:
        place = out / scene.name if len(scenes) > 1 else out
        files += export_case(scene, place, levels or None, conforming or template is not None)
    if template:
        files += write_template(out)
    names, folders = [str(file) for file in files], f"{out}/<case>" if len(scenes) > 1 else out
    then = (
        f"answer in {folders}/level-<k>/solution.json and .vtu, then: "
        f"verify import {case} {out} --solver NAME --out RUN"
    )
    return print_answer(as_json, {"case": case, "files": names}, [*names, then])


def import_(
    case: Cases,
    answers: Annotated[Path, Arg("DIR")],
    *,
    solver: Annotated[str, Arg("NAME")],
    out: Annotated[Path, Arg("RUN")],
    beside: Annotated[Sequence[str], Arg("NAME")] = (),
    judged_as: Annotated[str | None, Arg("NAME")] = None,
    timeout: Timeout = 600.0,
    repetitions: Repetitions = 1,
    jobs: Jobs = 1,
    strict: Strict = False,
    as_json: Annotated[bool, Arg(flags=("--json",))] = False,
) -> int:
    """Compare and judge the answers of another program.

    Parameters
    ----------
    answers
        directory with level-<k>/solution.json; of several cases in <case>/
    solver
        what the program is called in the report
    out
        run directory; one of an earlier import of the same cases keeps the other programs
    beside
        solver to run beside it; repeat for several (default: those that checks compare with, where
        they are installed, and the reference)
    judged_as
        checks that a case makes of this solver by its name are made of the program too
    as_json
        print the verdicts as JSON

    Examples
    --------
      verify import statics/f3_inclined f3 --solver freefem --out run
      verify import statics/f3_inclined f3 --solver freefem --beside xfem --out run
      verify import benchmark answers --solver mine --out run -j 2

    Exit codes as of `verify run`.
    """
    from verify.processes import start_server

    start_server()  # it loads while this process does
    from verify.cli.progress import progress_on
    from verify.cli.ranking import rank_run
    from verify.cli.run import say_results
    from verify.exchange import answers_of
    from verify.exchange.comparison import compare_answers
    from verify.report.rendering import render
    from verify.runner.checking import check_solver_name
    from verify.runner.fingerprint import cache_folder
    from verify.runner.selection import Options, select_cases

    for name in beside:
        check_solver_name(name, "--beside")
    scenes = select_cases([case], weight="heavy")
    found = answers_of(scenes, answers)
    options = Options(tuple(beside), repetitions, jobs=jobs, timeout=timeout, cache=cache_folder())
    with progress_on(sys.stderr) as progress:
        results = compare_answers(
            scenes, found, solver, out, options, progress, judged_as, command_line()
        )
    rank_run(out, results, {}, False, timeout, print)
    return say_results(results, str(render(out, jobs=jobs)), strict, as_json)


def conform(
    solver: Annotated[str, Arg("'SOLVER [PARAMETER=VALUE …]'")],
    *,
    parameters: Annotated[Sequence[str], Arg("NAME=VALUE", ("--set",))] = (),
    checks: Annotated[Sequence[str], Arg("NAME", ("--check",))] = (),
    timeout: Timeout = 120.0,
    as_json: Annotated[bool, Arg(flags=("--json",))] = False,
) -> int:
    """Check a solver on what holds for every right solver, before it is ranked.

    Parameters
    ----------
    solver
        name of a solver, or module:Class
    parameters
        parameter of the solver; repeat for several
    checks
        only this check; repeat for several (default: all)
    as_json
        print the checks as JSON

    Examples
    --------
      verify conform xfem
      verify conform xfem --set tip=inside
      verify conform my_module:MySolver --json

    exit codes:
      0  every check that the solver did not refuse passes, or is off as it states
      1  a check fails
      2  no such solver, or it cannot be loaded
      3  the solver crashed, hung or failed on a scene that it did not refuse
      4  it refused everything
    """
    from verify.processes import start_server

    if ":" not in solver:
        start_server()  # it loads while this process does
    from verify.cli.progress import waiting_reported
    from verify.cli.run import of_one_solver
    from verify.conformance import conform, exit_code_of
    from verify.solvers.interface import one_name, parameters_of, solver_in

    name = one_name(solver)
    given = parameters_of(name, {solver_in(name): of_one_solver(parameters)})
    with waiting_reported(sys.stderr, f"conformance of {name}"):
        results = conform(name, given, timeout, checks)
    code = exit_code_of(results)
    width, lines = max(len(result.name) for result in results), []
    for one in results:
        lines.append(f"{one.name:<{width}}  {one.state:<8} {_number(one):<19} {one.claim}")
        lines += [f"{'':<{width}}  {one.reason}"] if one.reason else []
    answer = {"solver": name, "parameters": given, "exit": code}
    return print_answer(as_json, {**answer, "checks": list(map(asdict, results))}, lines, code)


def _number(result: "CheckResult") -> str:
    if result.observed is None or result.limit is None:
        return ""
    return f"{result.observed:.1e} {'≤' if result.state == 'pass' else '>'} {result.limit:.1e}"

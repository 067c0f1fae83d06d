"""``verify run``: select, run, rank, render, and say what came out."""

import contextlib
import shlex
import sys
import threading
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from verify.cli.signatures import Arg, Jobs, Repetitions, Strict, Timeout, count, positive
from verify.cli.streams import command_line, print_json, print_line
from verify.errors import InputError, RunStoppedError

if TYPE_CHECKING:
    from verify.result import CaseResult
    from verify.runner.run import RunSummary
    from verify.runner.selection import Options
    from verify.scene import Scene


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options of ``verify run``.

    Attributes
    ----------
    expression
        words with and, or, not, parentheses, looked for in name, title and tags
    out
        run directory
    quick
        only cases tagged quick
    heavy
        also cases tagged heavy
    memory
        resident memory above which a solve is killed (default: 80 %% of the machine's, shared by
        the processes)
    within
        time for the reference of each case: larger elements and fewer levels than the case asks
        for, if more is expected; verdicts are then by a coarser reference
    solvers
        solver to compare, or module:Class; with parameters it is a row of its own; repeat for
        several (default: those that the case names)
    judge
        solver that is judged; repeat for several (default: each that is asked and does not refuse
        the case); the others are compared and ranked only
    parameters
        parameter of a solver, e.g. xfem.scheme=implicit_euler; repeat for several
    cluster
        solve on the workers of the Dask scheduler at tcp://HOST:PORT or in this file
    ranks
        MPI ranks of each reference, here or on its worker
    references
        judge by the references in this file (`verify cache export`); solve none
    no_cache
        solve references again, and keep none
    conform
        check every solver with the suite of `verify conform` before ranking (default: if more than
        two are ranked)
    no_report
        leave the report to `verify report DIR`
    as_json
        print the verdicts as JSON
    """

    expression: Annotated[str | None, Arg("EXPR", ("-k",))] = None
    out: Annotated[Path, Arg("DIR")] = Path("verify-results")
    quick: Annotated[bool, Arg(exclusive=True)] = False
    heavy: Annotated[bool, Arg(exclusive=True)] = False
    jobs: Jobs = 1
    timeout: Timeout = 600.0
    memory: Annotated[float | None, Arg("GB", read=positive)] = None
    within: Annotated[float | None, Arg("S", read=positive)] = None
    solvers: Annotated[Sequence[str], Arg("'NAME [PARAMETER=VALUE …]'", ("--solver",))] = ()
    judge: Annotated[Sequence[str], Arg("NAME")] = ()
    parameters: Annotated[Sequence[str], Arg("SOLVER.NAME=VALUE", ("--set",))] = ()
    repetitions: Repetitions = 3
    strict: Strict = False
    cluster: Annotated[str | None, Arg("ADDRESS")] = None
    ranks: Annotated[int, Arg("N", read=count)] = 1
    references: Annotated[Path | None, Arg("BUNDLE")] = None
    no_cache: bool = False
    conform: bool | None = None
    no_report: bool = False
    as_json: Annotated[bool, Arg(flags=("--json",))] = False


def run(cases: Annotated[Sequence[str], Arg("CASE")] = (), *, asked: RunOptions) -> int:
    """Solve, compare and judge cases, and render the report.

    Parameters
    ----------
    cases
        name, folder, pattern or file of a case (default: all)

    Examples
    --------
      verify run statics/f1_patch --out out
      verify run my_case.toml --out mine --solver xfem --timeout 60
      verify run -k "demo and not tissue" --out out -j 2
      verify run "statics/*" --quick --out out --strict --json > verdicts.json

    Which suite first: -k demo (a minute) shows that all works here; then --quick (minutes); without
    a selection all cases run that are not tagged heavy.

    A run that was stopped is resumed by the same command: finished solves are reused if their
    scene, their solver's parameters and the code are the same. Each solve runs in a process of its
    own, on one thread. With -j above 1 the timings are marked as contended.

    exit codes:
      0  every verdict is PASS (or UNDECIDED, without --strict; or a known finding of its case)
      1  a verdict is FAIL, of whichever solver; goes before 3: it stands whatever others would say
      2  bad input or usage; nothing was run, nothing was written
      3  a solve failed, timed out, ran out of memory, or could not be stored
      4  nothing ran: no case matches, or every solver refused
      5  with --strict: something is UNDECIDED, refused, warned of, or without any verdict
      128+n  stopped by signal n (130: Ctrl-C); finished solves stay
    """
    if not asked.solvers or any(":" not in name for name in asked.solvers):
        from verify.processes import start_server

        if find_spec("numba") is None:  # this process does without, its solvers do not
            raise ModuleNotFoundError("No module named 'numba'", name="numba")
        start_server()  # it loads while this process does
    from verify.cli.run_text import costs_of, run_line, suites_line
    from verify.runner.run import NOTHING_RAN
    from verify.runner.selection import select_cases

    names, parameters = _solvers_of(asked)
    weight = "quick" if asked.quick else "heavy" if asked.heavy else "normal"
    if not (scenes := select_cases(cases, asked.expression, weight)):
        print("verify: no case matches; `verify list` shows them all", file=sys.stderr)
        return NOTHING_RAN
    options = _options(asked, names, parameters)
    if not asked.no_report:
        threading.Thread(target=_load_report).start()  # while processes solve
    costs = [(scene, costs_of(scene, options)) for scene in scenes]
    expected = run_line(costs, options.jobs)
    if not (cases or asked.expression or asked.quick):
        expected = f"{suites_line(costs, options.jobs)}\n{expected}"
    done = _solved(asked, scenes, options, expected)
    if isinstance(done, int):
        return done
    summary, report = done
    return say_results(summary.results, report, asked.strict, asked.as_json, summary.reused)


def say_results(
    results: "Sequence[CaseResult]",
    report: str | None,
    strict: bool,
    as_json: bool,
    reused: int = 0,
) -> int:
    """Print what came out of judged cases; return the exit code."""
    from verify.cli.run_text import verdict_lines
    from verify.report.answers import answers
    from verify.runner.run import exit_code

    code = exit_code(results, strict)
    if as_json:
        answer = [_answer(result) for result in results]
        print_json({"exit": code, "report": report, "cases": answer})
        return code
    for line in verdict_lines(results):
        print_line(line)
    for one in answers(results):
        print_line(f"{one.question}: {one.sentence}")
    if reused:
        print(f"{reused} finished solves of before were reused")
    if report:
        print(f"report: {report}")
    return code


def _solvers_of(asked: RunOptions) -> tuple[list[str], dict[str, dict[str, Any]]]:
    """Return the solvers that are asked for, and the parameters of each."""
    from verify.runner.checking import check_solver_name
    from verify.solvers.interface import one_name, parameters_of

    names = [
        name for entry in asked.solvers for part in entry.split(",") if (name := one_name(part))
    ]
    for name in names:
        check_solver_name(name, "--solver")
    parameters = of_solvers(asked.parameters)
    for name in parameters:
        check_solver_name(name, "--set")
    parameters |= {name: parameters_of(name, parameters) for name in names if " " in name}
    return names, parameters


def _options(
    asked: RunOptions, names: list[str], parameters: dict[str, dict[str, Any]]
) -> "Options":
    from verify.runner.fingerprint import cache_folder
    from verify.runner.selection import Options
    from verify.solvers.interface import one_name

    alike = ("repetitions", "jobs", "timeout", "references", "cluster", "ranks", "within")
    return Options(
        solvers=tuple(dict.fromkeys(names)),
        parameters=parameters,
        memory=asked.memory * 1e9 if asked.memory else None,
        cache=None if asked.no_cache else cache_folder(),
        judge_only=tuple(dict.fromkeys(map(one_name, asked.judge))),
        **{name: getattr(asked, name) for name in alike},
    )


def _solved(
    asked: RunOptions, scenes: "list[Scene]", options: "Options", expected: str
) -> "tuple[RunSummary, str | None] | int":
    """Solve, rank and render; return the exit code of a run that was stopped."""
    from verify.cli.progress import progress_on
    from verify.cli.ranking import rank_run
    from verify.runner.run import run_cases

    with progress_on(sys.stderr, expected) as progress:

        def announce(text: str) -> None:
            progress.say(text)
            progress.doing(text)

        progress.doing("checking cases and solvers")
        try:
            summary = run_cases(scenes, asked.out, options, progress, command_line())
        except RunStoppedError as stop:
            progress.close()
            print(
                f"verify: {stop}; the same command resumes it, "
                f"`verify report {shlex.quote(str(asked.out))}` renders what is finished",
                file=sys.stderr,
            )
            return 128 + stop.signum
        given = options.parameters
        rank_run(asked.out, summary.results, given, asked.conform, asked.timeout, announce)
        progress.doing(f"the report of {len(summary.results)} cases")
        if asked.no_report:
            return summary, None
        from verify.report.rendering import render

        return summary, str(render(asked.out, jobs=options.jobs))


def _answer(result: "CaseResult") -> dict[str, Any]:
    return {
        "case": result.case,
        "verdict": result.verdict,
        "verdicts": [asdict(record) for record in result.verdicts],
        "notices": [asdict(notice) for notice in result.notices],
        "solves": [
            {"solver": s.solver, "level": s.level, "status": s.status, "reason": s.reason}
            for s in result.solves
        ],
    }


def _load_report() -> None:
    with contextlib.suppress(Exception):  # reported when the report is to be written
        import_module("verify.report.rendering").load()


def of_one_solver(given: Iterable[str]) -> dict[str, Any]:
    """Read ``tip=partial`` … as the parameters of one solver.

    Raises
    ------
    InputError
        If one is not of this form.
    """
    return dict(_split(text, text, "--set tip=partial") for text in given)


def of_solvers(given: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Read ``xfem.tip=partial`` … as the parameters of several solvers.

    The solver ends at the last dot before the equals sign, so that ``module:Class`` works too.

    Raises
    ------
    InputError
        If one is not of this form.
    """
    found: dict[str, dict[str, Any]] = {}
    for text in given:
        example = "--set xfem.scheme=implicit_euler"
        key, equals, value = text.partition("=")
        solver, dot, name = key.rpartition(".")
        if not dot or not solver:
            raise InputError(f"--set {text}: expected SOLVER.NAME=VALUE, e.g. {example}")
        name, parsed = _split(f"{name}{equals}{value}", text, example)
        found.setdefault(solver, {})[name] = parsed
    return found


def _split(text: str, given: str, example: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.isidentifier():
        raise InputError(f"--set {given}: expected NAME=VALUE, e.g. {example}")
    from verify.solvers.interface import plain_value

    return name, plain_value(value)

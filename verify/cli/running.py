"""The command ``verify run``: select, run, render, and say what came out."""

import argparse
import contextlib
import json
import shlex
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import asdict
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from verify.cli.cost_text import costs_of, run_line, suites_line
from verify.cli.progress import progress_on
from verify.cli.run_ranking import rank_run
from verify.cli.solver_parameters import of_solvers
from verify.cli.streams import print_line
from verify.cli.verdict_text import verdict_lines
from verify.runner import Options, RunStoppedError, exit_code, run_cases, select_cases
from verify.runner.checking import check_solver_name
from verify.runner.fingerprint import cache_folder
from verify.runner.run import NOTHING_RAN
from verify.solvers.named import one_name, parameters_of


def execute(arguments: argparse.Namespace) -> int:
    """Select, run, render, and say what came out."""
    if find_spec("numba") is None:  # this process does without, those that it starts do not
        raise ModuleNotFoundError("No module named 'numba'", name="numba")
    asked = (one_name(part) for entry in arguments.solvers for part in entry.split(","))
    names = [name for name in asked if name]
    for name in names:
        check_solver_name(name, "--solver")
    parameters = of_solvers(arguments.parameters)
    for name in parameters:
        check_solver_name(name, "--set")
    parameters |= {name: parameters_of(name, parameters) for name in names if " " in name}
    weight = "quick" if arguments.quick else "heavy" if arguments.heavy else "normal"
    scenes = select_cases(arguments.cases, arguments.expression, weight)
    if not scenes:
        print("verify: no case matches; `verify list` shows them all", file=sys.stderr)
        return NOTHING_RAN
    options = _options(arguments, names, parameters)
    beside = not arguments.no_report and options.jobs > 1 and len(scenes) > 1
    if not arguments.no_report:
        threading.Thread(target=_load_report).start()  # while processes solve
    costs = [(scene, costs_of(scene, options)) for scene in scenes]
    expected = run_line(costs, options.jobs)
    if not (arguments.cases or arguments.expression or arguments.quick):
        expected = f"{suites_line(costs, options.jobs)}\n{expected}"
    command = shlex.join(["verify", *sys.argv[1:]])
    with progress_on(sys.stderr, expected) as progress, _drawings(beside) as drawings:

        def announce(text: str) -> None:
            progress.say(text)
            progress.doing(text)

        progress.doing("checking cases and solvers")
        try:
            summary = run_cases(scenes, arguments.out, options, progress, command, drawings)
        except RunStoppedError as stop:
            progress.close()
            print(
                f"verify: {stop}; the same command resumes it, "
                f"`verify report {shlex.quote(str(arguments.out))}` renders what is finished",
                file=sys.stderr,
            )
            return 128 + stop.signum
        conform, timeout = arguments.conform, arguments.timeout
        rank_run(arguments.out, summary.results, parameters, conform, timeout, announce)
        progress.doing(f"the report of {len(summary.results)} cases")
        report = None if arguments.no_report else _rendered(arguments.out, drawings)
    code = exit_code(summary.results, arguments.strict)
    if arguments.json:
        cases = [
            {
                "case": result.case,
                "verdict": result.verdict,
                "verdicts": [asdict(record) for record in result.verdicts],
                "notices": [asdict(notice) for notice in result.notices],
                "solves": [
                    {"solver": s.solver, "level": s.level, "status": s.status, "reason": s.reason}
                    for s in result.solves
                ],
            }
            for result in summary.results
        ]
        print(json.dumps({"exit": code, "report": report, "cases": cases}, indent=2))
        return code
    for line in verdict_lines(summary.results):
        print_line(line)
    if summary.reused:
        print(f"{summary.reused} finished solves of before were reused")
    if report:
        print(f"report: {report}")
    return code


def _options(
    arguments: argparse.Namespace, names: list[str], parameters: dict[str, dict[str, Any]]
) -> Options:
    return Options(
        solvers=tuple(dict.fromkeys(names)),
        repetitions=arguments.repetitions,
        parameters=parameters,
        jobs=arguments.jobs,
        timeout=arguments.timeout,
        memory=arguments.memory * 1e9 if arguments.memory else None,
        cache=None if arguments.no_cache else cache_folder(),
        references=arguments.references,
        cluster=arguments.cluster,
        ranks=arguments.ranks,
        judge_only=tuple(dict.fromkeys(map(one_name, arguments.judge_only))),
    )


@contextlib.contextmanager
def _drawings(beside: bool) -> Iterator[Path | None]:
    """Give a folder for the cases that are drawn beside solves; None if none is."""
    if not beside:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="verify-") as folder:
        yield Path(folder)


def _load_report() -> None:
    with contextlib.suppress(Exception):  # it is said when the report is to be written
        import_module("verify.report").load()


def _rendered(directory: Path, drawings: Path | None) -> str:
    from verify.report import render

    return str(render(directory, drawings=drawings))

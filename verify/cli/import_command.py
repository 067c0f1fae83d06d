"""``verify import``: the answers of another program, compared like those of the own solvers."""

import argparse
import json
import shlex
import sys
from dataclasses import asdict

from verify.cli.progress import progress_on
from verify.cli.verdict_text import verdict_lines
from verify.exchange import read_answers
from verify.exchange.comparison import compare_answers
from verify.runner import Options, RunStoppedError, exit_code
from verify.runner.checking import check_solver_name
from verify.scene import load_scene


def execute(arguments: argparse.Namespace) -> int:
    """Read, compare, judge, report."""
    for name in arguments.beside:
        check_solver_name(name, "--beside")
    scene = load_scene(arguments.case)
    answers = read_answers(scene, arguments.answers)
    options = Options(
        solvers=tuple(arguments.beside),
        repetitions=arguments.repetitions,
        timeout=arguments.timeout,
    )
    with progress_on(sys.stderr) as progress:
        try:
            result = compare_answers(
                scene,
                answers,
                arguments.solver,
                arguments.out,
                options,
                progress,
                arguments.judged_as,
                shlex.join(["verify", *sys.argv[1:]]),
            )
        except RunStoppedError as stop:
            progress.close()
            print(f"verify: {stop}; the same command resumes it", file=sys.stderr)
            return 128 + stop.signum
    from verify.cli.run_ranking import rank_run
    from verify.report import render

    rank_run(arguments.out, [result], {}, False, arguments.timeout, print)
    report, code = render(arguments.out), exit_code([result], arguments.strict)
    if arguments.json:
        verdicts = [asdict(record) for record in result.verdicts]
        answer = {"exit": code, "report": str(report), "case": result.case, "verdicts": verdicts}
        answer["notices"] = [asdict(notice) for notice in result.notices]
        print(json.dumps(answer, indent=2))
        return code
    for line in verdict_lines([result]):
        print(line)
    print(f"report: {report}")
    return code

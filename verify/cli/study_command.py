"""``verify study``: what slivers do, whether energy is kept, what accuracy costs."""

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from typing import Any


def execute(arguments: argparse.Namespace) -> int:
    """Run a study, write its record and table, render its page."""
    from verify.errors import InputError
    from verify.study.record import make_directory

    new = not arguments.out.exists()
    make_directory(arguments.out)  # before minutes of work
    try:
        return _study(arguments)
    except InputError:
        if new:
            with suppress(OSError):  # something is in it
                arguments.out.rmdir()
        raise


def _study(arguments: argparse.Namespace) -> int:
    from verify.report.study_page import render_study
    from verify.study.record import write_study

    def announce(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    command = shlex.join(["verify", *sys.argv[1:]])
    if arguments.study in ("cost", "budget", "thesis", "iterations"):
        from verify.cli import case_studies

        study = getattr(case_studies, arguments.study)(arguments, announce)
    elif arguments.study == "calibration":
        from verify.study.calibration import calibration_study

        study = calibration_study(arguments.quick, announce, arguments.seed, arguments.out)
    else:
        study = _over_scenes(arguments, announce)
    written = write_study(arguments.out, arguments.study, study, command)
    page = render_study(arguments.out, arguments.study)
    if arguments.as_json:
        said = [asdict(finding) for finding in study.findings]
        print(json.dumps({"record": str(written), "report": str(page), "findings": said}, indent=2))
        return 0
    for finding in study.findings:
        mark = "shown" if finding.verdict is None else str(finding.verdict)
        print(f"{mark}: {finding.topic}: {finding.sentence} [expected: {finding.expected}]")
    print(f"report: {page}")
    return 0


def _over_scenes(arguments: argparse.Namespace, announce: Callable[[str], None]) -> Any:
    """Run the study of slivers or of energy over the cases and solvers that are asked for."""
    from verify.runner.selection import select_cases
    from verify.study.energy import energy_study
    from verify.study.measured_scenes import Making, variant_of
    from verify.study.slivers import sliver_study

    slivers = arguments.study == "slivers"
    cases = arguments.cases or (["slivers/*"] if slivers else [])
    expression = None if slivers or arguments.cases else "energy"
    quick = arguments.quick and not arguments.cases
    scenes = select_cases(cases, expression, "quick" if quick else "heavy")
    variants = [variant_of(text) for text in arguments.solvers or ("xfem", "conforming")]
    study = sliver_study if slivers else energy_study
    processes = arguments.processes or len(os.sched_getaffinity(0))
    making = Making(arguments.out / f"{arguments.study}-parts", announce, processes)
    return study(scenes, variants, making, arguments.quick)

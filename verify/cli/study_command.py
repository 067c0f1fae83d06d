"""``verify study``: what slivers do, whether energy is kept, what accuracy costs."""

import argparse
import json
import shlex
import sys
from contextlib import suppress
from dataclasses import asdict

__all__ = ["execute"]


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
    from verify.result import Verdict
    from verify.study.record import write_study

    def announce(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    command = shlex.join(["verify", *sys.argv[1:]])
    if arguments.study in ("cost", "budget", "thesis"):
        from verify.cli import case_studies

        study = getattr(case_studies, arguments.study)(arguments, announce)
        findings, record, rows = study.findings, study.as_record(), study.rows()
    elif arguments.study == "slivers":
        from verify.study.slivers import sliver_study

        dimensions = (arguments.dimension,) if arguments.dimension else (2, 3)
        slivers = sliver_study(dimensions, arguments.quick, announce, arguments.processes)
        findings, record = slivers.findings, slivers.as_record()
        rows = [asdict(m) for m in slivers.measurements]
    elif arguments.study == "calibration":
        from verify.study.calibration import calibration_study

        calibration = calibration_study(arguments.quick, announce)
        findings, record, rows = (
            calibration.findings, calibration.as_record(), calibration.rows()
        )  # fmt: skip
    else:
        from verify.study.energy import energy_study

        energy = energy_study(arguments.quick, announce)
        findings, record, rows = energy.findings, energy.as_record(), energy.rows()
    written = write_study(arguments.out, arguments.study, record, rows, command)
    page = render_study(arguments.out, arguments.study)
    if arguments.json:
        said = [asdict(finding) for finding in findings]
        print(json.dumps({"record": str(written), "report": str(page), "findings": said}, indent=2))
        return 0
    for finding in findings:
        marks = {Verdict.PASS: "as expected", Verdict.FAIL: "NOT KEPT", None: "shown"}
        mark = marks.get(finding.verdict, str(finding.verdict))
        print(f"{mark}: {finding.topic}: {finding.sentence} [expected: {finding.expected}]")
    print(f"report: {page}")
    return 0

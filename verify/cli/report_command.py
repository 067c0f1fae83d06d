"""``verify report``: render again, compute nothing."""

import argparse
import sys

from verify.cli.waiting import said_to_wait
from verify.errors import InputError


def execute(arguments: argparse.Namespace) -> int:
    """Render the report of a run, or the pages of the studies in a directory."""
    from verify.report import render
    from verify.report.study_page import render_study, studies_in

    directory = arguments.directory
    if (directory / "run.json").is_file():
        with said_to_wait(sys.stderr, f"the report of {directory}"):
            page = render(directory, arguments.format)
        print(f"report: {page}")
        return 0
    if not (kinds := studies_in(directory)):
        raise InputError("not a run (it has no run.json) nor that of a study", str(directory))
    form = "markdown" if arguments.format == "summary" else arguments.format
    for kind in kinds:
        print(f"report: {render_study(directory, kind, form)}")
    return 0

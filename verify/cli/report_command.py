"""``verify report``: render again, compute nothing."""

import argparse
import sys

from verify.cli.waiting import said_to_wait
from verify.errors import InputError


def execute(arguments: argparse.Namespace) -> int:
    """Render the report of a run, or the pages of the studies in a directory."""
    from verify.report import render, render_markdown, render_pdf, render_summary
    from verify.report.study_page import render_study, studies_in

    directory = arguments.directory
    if (directory / "run.json").is_file():
        made = {"html": render, "markdown": render_markdown, "pdf": render_pdf,
                "summary": render_summary}  # fmt: skip
        with said_to_wait(sys.stderr, f"the report of {directory}"):
            page = made[arguments.format](directory)
        print(f"report: {page}")
        return 0
    if not (kinds := studies_in(directory)):
        raise InputError("not a run (it has no run.json) nor that of a study", str(directory))
    form = "markdown" if arguments.format == "summary" else arguments.format
    for kind in kinds:
        print(f"report: {render_study(directory, kind, form)}")
    return 0

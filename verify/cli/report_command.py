"""``verify report``: render again, compute nothing."""

import argparse

from verify.errors import InputError

__all__ = ["execute"]


def execute(arguments: argparse.Namespace) -> int:
    """Render the report of a run directory."""
    if not (arguments.directory / "run.json").is_file():
        raise InputError("not a run (it has no run.json)", str(arguments.directory))
    from verify.report import render, render_markdown, render_pdf

    made = {"html": render, "markdown": render_markdown, "pdf": render_pdf}[arguments.format]
    print(f"report: {made(arguments.directory)}")
    return 0

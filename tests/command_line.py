"""The command line in this process: most of what a new one takes is importing."""

import os
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from subprocess import CompletedProcess
from unittest.mock import patch

from verify.cli import main
from verify.files import read_json
from verify.runner import child


def without_waits(text):
    """Return the output of a command without its waits, which depend on the machine."""
    return "".join(line for line in text.splitlines(True) if not line.startswith("… "))


def run_here(arguments, folder, environment=None):
    """Run ``verify ARGUMENTS`` in a folder; return its exit code and output."""
    words, out, err = [str(word) for word in arguments], StringIO(), StringIO()
    with (
        chdir(folder),
        patch.dict(os.environ, environment or {}),
        patch("sys.argv", ["verify", *words]),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            code = main(words)
        except SystemExit as leaving:  # of argparse
            code = leaving.code
    return CompletedProcess(words, code, out.getvalue(), err.getvalue())


def forking(harmless):
    """Fork the processes of guests that do no harm to theirs, as of own solvers."""
    fresh = child._fresh

    def start(run, log, environment):
        question = Path(run[-1])
        if len(run) == 2 and harmless(str(read_json(question).get("solver", "")).split(" ")[0]):
            process = child._forked(run[0], question, log.resolve(), environment)
            return process or fresh(run, log, environment)
        return fresh(run, log, environment)

    return patch.object(child, "_fresh", start)

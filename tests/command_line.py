"""The command line in this process: most of what a new one takes is importing."""

import os
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from runpy import run_path
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
    words = [str(word) for word in arguments]
    return _run_here(["verify", *words], lambda: main(words), folder, environment)


def run_script_here(script, arguments, folder, environment):
    """Run ``python SCRIPT ARGUMENTS`` in a folder; return its exit code and output."""
    words = [str(folder / script), *arguments]
    return _run_here(words, lambda: run_path(words[0], run_name="__main__"), folder, environment)


def _run_here(words, call, folder, environment):
    out, err = StringIO(), StringIO()
    with (
        chdir(folder),
        patch.dict(os.environ, environment or {}),
        patch("sys.argv", words),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            code = call()
        except SystemExit as leaving:  # of argparse
            code = leaving.code
    code = code if isinstance(code, int) else 0
    return CompletedProcess(words[1:], code, out.getvalue(), err.getvalue())


def forking(harmless):
    """Fork the processes that load and run guests that do no harm to theirs, as of own solvers."""
    fresh = child._fresh

    def start(run, log, environment):
        question = Path(run[-1])
        asked = read_json(question) if len(run) == 2 else {}
        name = str(asked.get("solver") or asked.get("arguments", {}).get("name", ""))
        if len(run) == 2 and harmless(name.split(" ")[0]):
            process = child._forked(run[0], question, log.resolve(), environment)
            return process or fresh(run, log, environment)
        return fresh(run, log, environment)

    return patch.object(child, "_fresh", start)

"""Pages of the documentation: their blocks of code, and their commands, run in order."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from command_line import forking, run_here

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


def blocks(page, language):
    """Return the blocks of a language in a page, which is named from `docs` on."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(page):
    """Return the lines of the page's blocks of `sh`."""
    return [line for block in blocks(page, "sh") for line in block.splitlines() if line.strip()]


def run_line(line, folder, path=None):
    """Run a command line in a folder, where `path` (default the folder) is on the search path.

    `verify` runs in this process, unless it is to find a package that is installed in the folder;
    guests that it finds there run in processes forked from its server.
    """
    path = path or folder
    command, _, target = line.partition(" > ")
    first, *words = shlex.split(command)
    environment = {"PYTHONPATH": os.pathsep.join([str(path), str(ROOT), *_given()])}
    if first == "verify" and not list(folder.glob("*.dist-info")):
        with patch.object(sys, "path", [str(path), *sys.path]), forking(lambda _: True):
            done = run_here(words, folder, environment)
        for name in {file.stem for file in path.glob("*.py")}:
            sys.modules.pop(name, None)
    else:
        own = {"verify": [sys.executable, "-m", "verify"], "python": [sys.executable]}
        done = subprocess.run(
            [*own.get(first, [first]), *words],
            cwd=folder,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=300,
        )
    if target:
        (folder / target.strip()).write_text(done.stdout, encoding="utf-8")
    return done


def _given():
    return [given] if (given := os.environ.get("PYTHONPATH")) else []

"""Pages of the documentation: their blocks of code, and their commands, run in order."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from command_line import forking, run_here, run_script_here

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


def blocks(page, language):
    """Return the blocks of a language in a page, which is named from `docs` on."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(page):
    """Return the lines of the page's blocks of `sh`."""
    return [line for block in blocks(page, "sh") for line in block.splitlines() if line.strip()]


def rows_of_table(page, title):
    """Return the cells of the rows of a page's table, which is named by its first column."""
    text = (DOCS / page).read_text(encoding="utf-8")
    (table,) = re.findall(
        rf"^\| {re.escape(title)} \|.*\n\|[-|]+\n((?:\|.*\n)+)", text, re.MULTILINE
    )
    return [row[2:-2].split(" | ") for row in table.splitlines()]


def run_line(line, folder, path=None):
    """Run a command line in a folder, where `path` (default the folder) is on the search path.

    `verify` and scripts run in this process; guests that it finds in the folder run in processes
    forked from its server.
    """
    path = path or folder
    command, _, target = line.partition(" > ")
    first, *words = shlex.split(command)
    environment = {"PYTHONPATH": os.pathsep.join([str(path), str(ROOT), *_given()])}
    with patch.object(sys, "path", [str(path), *sys.path]), forking(lambda _: True):
        if first == "verify":
            done = run_here(words, folder, environment)
        elif first == "python":
            done = run_script_here(words[0], words[1:], folder, environment)
        else:
            done = subprocess.run([first, *words], cwd=folder, capture_output=True, text=True)
    for name in {file.stem for file in path.glob("*.py")}:
        sys.modules.pop(name, None)
    if target:
        (folder / target.strip()).write_text(done.stdout, encoding="utf-8")
    return done


def _given():
    return [given] if (given := os.environ.get("PYTHONPATH")) else []

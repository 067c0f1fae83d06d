import json
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parent))


@pytest.fixture
def baseline(tmp_path, capsys):
    """Run ``verify baseline ACTION …`` on a file; returns the exit code and what it said."""
    from verify.cli import main

    file = tmp_path / "baseline.json"

    def call(action, *arguments):
        which = [] if action == "diff" else ["--file", str(file)]
        code = main(["baseline", action, *map(str, arguments), *which, "--json"])
        out, err = capsys.readouterr()
        return code, json.loads(out) if out else err

    call.file = file
    return call

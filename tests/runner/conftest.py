"""A case, and the command line with the fake solvers at hand, in this process or one of its own."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from case_texts import STRETCHED, body_text
from command_line import forking, run_here

HERE = Path(__file__).parent
HARMLESS = {"guests:Chatty", "guests:Elsewhere", *(f"fake_solvers:{name}" for name in (
    "Instant", "Wrong", "Straining", "Refusing", "RefusingLate", "Raising",
    "NotFinite", "HangingOnLevelOne", "Hanging", "Hungry",
))}  # fmt: skip

CASE = (
    'tags = ["stretched"]\n'
    + body_text(
        "A stretched square", "It shall be stretched.", [1.0, 1.0], [[2, 2], [4, 4]], poisson="0.0"
    )
    + STRETCHED
)


@pytest.fixture
def case_text() -> str:
    """The text of a case that every solver can do."""
    return CASE


def _quick(arguments):
    """Add to a run that it makes no report and, unless told otherwise, solves once."""
    words = list(map(str, arguments))
    if words[0] == "run":
        told = any(word.startswith("--repetitions") for word in words)
        words += ["--no-report", *([] if told else ["--repetitions=1"])]
    return words


@dataclass
class CommandLine:
    """Runs ``verify`` in a folder."""

    folder: Path
    environment: dict[str, str]

    def start(self, *arguments, **environment):
        return subprocess.Popen(
            [sys.executable, "-m", "verify", *_quick(arguments)],
            cwd=self.folder,
            env={**self.environment, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            # a shell that starts the tests in the background hands Ctrl-C down as ignored
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    def __call__(self, *arguments, **environment):
        """Run in this process, and fork the solvers that do no harm to theirs."""
        if "--cluster" in arguments or "PYTHONPATH" in environment:  # of a fresh process
            process = self.start(*arguments, **environment)
            out, err = process.communicate(timeout=300)
            return subprocess.CompletedProcess(arguments, process.returncode, out, err)
        with forking(HARMLESS.__contains__):
            return run_here(_quick(arguments), self.folder, {**self.environment, **environment})

    def records(self, out="out"):
        """Records of all solves, by (solver, level)."""
        files = (self.folder / out).glob("cases/*/*/record.json")
        records = [json.loads(file.read_text())["record"] for file in files]
        return {(r["solver"].removeprefix("fake_solvers:"), r["level"]): r for r in records}


@pytest.fixture
def verify(tmp_path):
    (tmp_path / "square.toml").write_text(CASE)
    paths = [str(HERE), str(HERE.parent.parent), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return CommandLine(tmp_path, environment)

"""Foreign solvers made on the fly: the example program, and a package of one line."""

import base64
import hashlib
import shutil
import sys
import zipfile

import pytest

from verify.foreign import installing
from verify.solvers import interface

RECORD = """
title = "Linear elements"
licence = "Apache-2.0"
module = "{module}"
version_of = "{module}"
conforming = true
[install]
kind = "{kind}"
python = "{python}"
how = "ask the administrator"
[parameters]
weight = 1.0
[takes]
dimensions = [2]
analyses = ["static"]
kinematics = ["linear"]
cuts = ["polyline"]
materials = "one"
"""


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """An empty list of programs, and a folder of installations."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setattr(installing, "PROGRAMS", folder)
    monkeypatch.setattr(interface, "_PROGRAMS", folder)
    monkeypatch.setenv("VERIFY_SOLVERS", str(tmp_path / "solvers"))
    return folder


@pytest.fixture
def add_example(programs):
    """Enter the example program under a name."""
    original = installing.Path(installing.__file__).parent / "programs"

    def add(name, module="numpy", kind="system", python=sys.executable, text=None):
        (programs / name).mkdir()
        record = RECORD.format(module=module, kind=kind, python=python)
        (programs / name / "solver.toml").write_text(record)
        example = (original / "example.py").read_text()
        (programs / name / "program.py").write_text(example if text is None else text)
        shutil.copy(original / "exchange_files.py", programs)
        return programs / name

    return add


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """A package ``cutfake`` 1.5 as a wheel that pip finds; return its hash."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    file = folder / "cutfake-1.5-py3-none-any.whl"
    info = "cutfake-1.5.dist-info"
    texts = {
        "cutfake.py": "ANSWER = 42\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: cutfake\nVersion: 1.5\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    rows = []
    with zipfile.ZipFile(file, "w") as archive:
        for name, text in texts.items():
            archive.writestr(name, text)
            digest = base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest())
            rows.append(f"{name},sha256={digest.decode().rstrip('=')},{len(text)}")
        archive.writestr(f"{info}/RECORD", "\n".join([*rows, f"{info}/RECORD,,"]) + "\n")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    return hashlib.sha256(file.read_bytes()).hexdigest()

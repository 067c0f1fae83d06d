"""Processes forked from a server: as apart from each other as fresh ones, ended as a whole."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from verify.files import read_json, write_json
from verify.runner.child import Child
from verify.scene import load_scene, scene_content

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")

SOLVER = """
    import os, subprocess, sys, time
    import numpy as np
    from pathlib import Path
    class Mine:
        name = "mine"
        def refuses(self, scene): return None
        def levels(self, scene): return 1
        def solve(self, scene, level, repetitions=1):
            {body}
            raise ValueError({said})
"""


@pytest.fixture
def prepared(tmp_path, case_text, monkeypatch):
    """Give a function that makes a folder with a solver, and goes there."""
    (tmp_path / "square.toml").write_text(case_text)
    content = scene_content(load_scene(tmp_path / "square.toml"))

    def prepare(name, body="", said="''"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "mine.py").write_text(textwrap.dedent(SOLVER.format(body=body, said=said)))
        job = {"scene": content, "solver": "mine:Mine", "level": 0, "repetitions": 1}
        write_json({**job, "parameters": {}}, folder / "job.json")
        monkeypatch.chdir(folder)
        return folder

    return prepare


@pytest.fixture
def solved(prepared):
    """Give a function that runs a solver of a folder of its own, forked."""

    def start(name, body="", said="''"):
        folder = prepared(name, body, said)
        child = _child(folder)
        assert isinstance(child._process, BaseProcess)
        return child, folder

    return start


def _child(folder):
    job, log = folder / "job.json", folder / "log.txt"
    return Child("verify.runner.solve", job, log, 60.0, 4e9, own=True)


def ended(child):
    while (ending := child.poll()) is None:
        time.sleep(0.02)
    return ending


def reason(folder):
    return read_json(folder / "outcome.json")["reason"]


def written(file):
    """Wait for the words in a file."""
    for _ in range(15_000):
        if file.exists() and (words := file.read_text().split()):
            return words
        time.sleep(0.02)
    raise AssertionError(f"{file} was not written")


def test_nothing_leaks_and_each_is_in_its_folder_with_its_environment(solved, monkeypatch):
    """Solvers of one name in three folders, and what one has done to a library."""
    said = "' '.join([str(hasattr(np, 'spoilt')), os.getcwd(), os.environ.get('WORD', 'none'), "
    said += "str(np.random.rand())])"
    drawn = set()
    for number, body in enumerate(("", "np.spoilt = 7", "")):
        monkeypatch.setenv("WORD", str(number))
        child, folder = solved(f"number_{number}", body, said)
        assert ended(child).returncode == 0
        _, spoilt, place, word, random = reason(folder).split()
        assert (spoilt, place, word) == (str(bool(body)), str(folder), str(number))
        drawn.add(random)
    assert len(drawn) == 3


def test_the_server_has_started_neither_threads_nor_mpi_and_has_one_thread(solved):
    said = (
        "str([m for m in ('mpi4py.MPI', 'dolfinx', 'petsc4py.PETSc', 'gmsh', 'vtk') "
        "if m in sys.modules]) + str(len(os.listdir('/proc/self/task'))) "
        "+ str('verify.solvers.xfem' in sys.modules)"
        "+ str(sys.modules['numba'].get_num_threads())"
    )
    child, folder = solved("imports", said=said)
    ended(child)
    assert reason(folder) == "ValueError: []1True1"


def test_memory_is_that_of_the_process_alone(solved):
    child, _ = solved("memory", body="x = np.ones(50_000_000); time.sleep(1)")
    assert 4e8 < ended(child).peak < 7e8  # 400 MB of it, and imported modules


SCRIPT = """
import time
from pathlib import Path
from verify.runner.child import Child
with open("begun", "a") as file:
    file.write("begun ")
child = Child("verify.runner.solve", Path("job.json"), Path("log.txt"), 600.0, 4e9, own=True)
while child.poll() is None:
    time.sleep(0.02)
"""


def test_all_of_them_die_with_the_runner_whose_script_is_not_run_again_in_them(prepared):
    """Killed with no chance to end anything: server, process and what that has started.

    The script has no ``if __name__ == "__main__"``, as people write them.
    """
    body = (
        "p = subprocess.Popen(['sleep', '600'], start_new_session=True)\n"
        "            Path('new').write_text(f'{os.getpid()} {os.getppid()} {p.pid}')\n"
        "            os.rename('new', 'pids'); time.sleep(600)"
    )
    folder = prepared("running", body=body)
    (folder / "mine_script.py").write_text(SCRIPT)
    runner = subprocess.Popen([sys.executable, "mine_script.py"], cwd=folder)
    pids = written(folder / "pids")
    assert (folder / "begun").read_text() == "begun "
    os.kill(runner.pid, signal.SIGKILL)
    runner.wait()
    for _ in range(15_000):
        left = [pid for pid in pids if Path("/proc", pid, "exe").exists()]
        if not left:
            return
        time.sleep(0.02)
    raise AssertionError(f"still running: {left}")

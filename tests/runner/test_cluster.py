"""The same run on a Dask cluster of two workers, one of which is killed: nothing is lost."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from verify.runner.engines import RemoteSolve

pytest.importorskip("distributed")


def wait_for(condition, what, seconds=300):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.05)


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def parent(pid):
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


@pytest.fixture
def cluster(verify):
    """A scheduler and two workers of one thread each; its scheduler file."""
    place, mark = verify.folder / "scheduler.json", verify.folder / "mark"
    environment = {
        **verify.environment,
        "HANG_MARK": str(mark),
        "COUNT_SOLVES": str(verify.folder / "solves"),
        "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "5s",
    }
    started = []

    def start(*words):
        log = (verify.folder / f"dask-{len(started)}.log").open("wb")
        command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
        options = ["--no-dashboard", "--scheduler-file", str(place)]
        started.append(
            subprocess.Popen([*command, *options], env=environment, stdout=log, stderr=log)
        )

    start("dask_scheduler", "--port", "0", "--host", "127.0.0.1")
    wait_for(place.exists, "the scheduler does not start")
    for _ in range(2):
        start("dask_worker", "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
    yield place
    for process in started:
        process.kill()
        process.wait()


def run(verify, cluster, solver):
    return verify.start(
        "run", "square.toml", "--out", "out", "--solver", solver, "--cluster", str(cluster)
    )


def test_a_killed_worker_loses_nothing(verify, cluster):
    mark = verify.folder / "mark"
    process = run(verify, cluster, "fake_solvers:HangingOnce")
    wait_for(lambda: mark.exists() and mark.read_text(), "no worker took the solve")
    solving = int(mark.read_text())
    os.kill(parent(solving), signal.SIGKILL)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    records = verify.records()
    assert {key: r["status"] for key, r in records.items()} == {
        ("HangingOnce", 0): "solved",
        ("HangingOnce", 1): "solved",
    }
    assert all("worker" in r["notes"] for r in records.values())
    wait_for(lambda: not alive(solving), "the solve outlived its worker")
    solves = (verify.folder / "solves").read_text().splitlines()
    assert len(solves) == 2  # what the dead worker had finished was not solved again


KilledWorker = type("KilledWorker", (Exception,), {})  # as Dask's, of several arguments


@pytest.mark.parametrize("reason, said", [
    (OSError("the network is down\nand more"), "the network is down"),
    (ValueError(), "ValueError"),
    (KilledWorker("solve", 3), "the workers that ran it died, several times over"),
])  # fmt: skip
def test_a_solve_that_the_cluster_lost_is_a_failure_with_its_reason(tmp_path, reason, said):
    future = SimpleNamespace(done=lambda: True, status="error", exception=lambda: reason)
    ending = RemoteSolve(future, tmp_path).poll()
    assert ending.returncode == 1
    assert (tmp_path / "log.txt").read_text() == f"{said}\n"

"""Engines that run solves: processes here, or workers of a Dask cluster (``--cluster ADDRESS``).

The scheduler of a cluster hands solves out, restarts those whose worker died, and waits for workers
that are to come. Each worker must have the same code and versions. No file system is shared: a
worker solves in a folder of its own, in a child with the limits of the run, and returns the files
as bytes. The child dies if the run is stopped. The comparison stays on the machine of the run.
"""

import logging
import re
import tempfile
import time
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json, write_whole
from verify.processes import memory_limit
from verify.provenance import provenance
from verify.runner.child import POLL_SECONDS, Child, Ending
from verify.runner.fingerprint import code_of_solver
from verify.scene import MeshFile, restore_scene
from verify.solvers.interface import is_built_in

_CONNECT_SECONDS, _LOOK_SECONDS = 15.0, 1.0


def solving(
    job: dict[str, Any], folder: Path, timeout: float, memory: float, forked: bool = True
) -> Child:
    """Start the process that solves what ``job.json`` in `folder` says; `forked` if it may be."""
    own = forked and is_built_in(job["solver"])
    files, ranks = (folder / "job.json", folder / "log.txt"), job.get("ranks", 1)
    return Child("verify.runner.solve", *files, timeout, memory, ranks, own=own)


class ClusterEngine:
    """The workers behind the scheduler at `address`.

    Parameters
    ----------
    address : str
        Address of the scheduler (``tcp://host:8786``), or its scheduler file.
    timeout : float
        Wall seconds of each solve.
    memory : float or None
        Bytes of resident memory of each solve.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers.
    """

    def __init__(self, address: str, timeout: float, memory: float | None) -> None:
        try:
            from distributed import Client
        except ModuleNotFoundError as error:
            raise InputError(
                f"needs '{error.name}', which is not installed: "
                "python -m pip install 'cutting-verification[cluster]'",
                "--cluster",
            ) from None
        place = {"scheduler_file": address} if Path(address).is_file() else {"address": address}
        if "address" in place and not re.fullmatch(r"(\w+://)?\S+:\d+", address):
            text = f"'{address}' is neither a scheduler file nor an address like tcp://host:8786"
            raise InputError(text, "--cluster")
        for name in ("distributed", "distributed.client"):  # its tracebacks are not for users
            logging.getLogger(name).setLevel(logging.ERROR)
        try:
            self._client: Any = Client(**place, timeout=_CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            text = f"no scheduler answers at '{address}' ({reason})"
            raise InputError(text, "--cluster") from None
        self._timeout, self._memory = timeout, memory

    @property
    def width(self) -> int:
        """Threads of all workers; one if none is there yet, so that something waits for them."""
        return max(1, sum(self._client.nthreads().values()))

    def start(self, job: dict[str, Any], folder: Path) -> "RemoteSolve":
        """Submit a solve."""
        scene = restore_scene(job["scene"])
        body = scene.geometry
        mesh = body.path.read_bytes() if isinstance(body, MeshFile) else None
        code, limits = code_of_solver(job["solver"]), (self._timeout, self._memory)
        future = self._client.submit(solve_remotely, job, mesh, code, *limits, pure=False)
        return RemoteSolve(future, folder)

    def close(self) -> None:
        """Leave the cluster, which goes on."""
        self._client.close()


class RemoteSolve:
    """A solve on some worker."""

    def __init__(self, future: Any, folder: Path) -> None:
        self._future, self._folder = future, folder
        self.log = folder / "log.txt"

    def poll(self) -> Ending | None:
        """Look once; write its files here if it ended."""
        if not self._future.done():
            return None
        if self._future.status != "finished":
            return self._lost(self._future.exception())
        ending, files = self._future.result()
        # the outcome last: its presence means that the rest is there
        for name in sorted(files, key=lambda name: name == "outcome.json"):
            write_whole(self._folder / Path(name).name, files[name])
        self._future.release()
        assert isinstance(ending, Ending)
        return ending

    def kill(self) -> None:
        """Cancel it; its worker kills the child within a second or so."""
        self._future.cancel(force=True)

    def _lost(self, reason: Any) -> Ending:
        text = str(reason).splitlines()[0] if str(reason) else type(reason).__name__
        if type(reason).__name__ == "KilledWorker":
            text = "the workers that ran it died, several times over"
        self.log.write_text(f"{text}\n", encoding="utf-8")
        return Ending(1, 0.0, 0.0)


def solve_remotely(
    job: dict[str, Any], mesh: bytes | None, code: str, timeout: float, memory: float | None
) -> tuple[Ending, dict[str, bytes]]:
    """Solve `job` on this worker; return how that ended, and the content of its files by name.

    Parameters
    ----------
    job : dict
        Content of ``job.json``.
    mesh : bytes or None
        Content of the scene's mesh file, if it has one.
    code : str
        Hash of the code and the versions at the run; other code here is not used.
    timeout, memory : float
        Limits of the child, s and bytes; default of the latter: 80 % of the worker's machine,
        shared by its threads.

    Raises
    ------
    InputError
        If the worker has other code.
    """
    if (here := code_of_solver(job["solver"])) != code:
        reason = f"the worker has other code or other versions ({here}, the run has {code})"
        raise InputError(f"{reason}: install the same on it")
    from distributed import get_worker

    worker = get_worker()
    limit = memory_limit(memory, max(1, worker.state.nthreads))
    with tempfile.TemporaryDirectory(prefix="verify-worker-") as place:
        folder = Path(place)
        if mesh is not None:
            _take_along(job, mesh, folder)
        write_json(job, folder / "job.json")
        child = solving(job, folder, timeout, limit, forked=False)  # a worker has threads
        try:
            ending = _watched(child, worker)
        finally:
            child.kill()
        _sign(folder / "outcome.json")
        files = {
            path.name: path.read_bytes()
            for path in folder.iterdir()
            if path.name != "job.json" and not path.name.startswith("geometry-")
        }
    return ending, files


def _sign(outcome: Path) -> None:
    """Note the worker's machine: the times are not of the machine of the run."""
    if outcome.exists():
        content = read_json(outcome)
        content.setdefault("notes", {})["worker"] = provenance()["cpu"]
        write_json(content, outcome)


def _take_along(job: dict[str, Any], mesh: bytes, folder: Path) -> None:
    """Write the mesh file where the scene will look for it."""
    scene = job["scene"]
    name = f"geometry-{Path(scene['scene']['geometry']['file']).name}"
    (folder / name).write_bytes(mesh)
    scene["scene"]["geometry"]["file"] = name
    scene["file"] = str(folder / "case.toml")


def _watched(child: Child, worker: Any) -> Ending:
    """Wait for the end; kill the child if its task is cancelled or its client gone."""
    from distributed.worker import thread_state

    key = getattr(thread_state, "key", None)
    looked = time.monotonic()
    while (ending := child.poll()) is None:
        time.sleep(POLL_SECONDS)
        if time.monotonic() - looked > _LOOK_SECONDS:
            looked = time.monotonic()
            task = worker.state.tasks.get(key)
            if key is not None and (task is None or task.state != "executing"):
                child.kill()
                break
    return ending or Ending(-9, 0.0, child.peak, "cancelled")

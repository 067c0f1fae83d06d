"""Solve on a worker of a cluster, in a child process, its files handed back as bytes.

No file system is shared: the worker solves in a folder of its own. The child has the same limits
as on the machine of the run, and dies if the run no longer wants its answer.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

from verify.json_files import read_json, write_json
from verify.provenance import provenance
from verify.runner.child import POLL_SECONDS, Child
from verify.runner.fingerprint import code_of_solver

_LOOK_SECONDS = 1.0


def solve_remotely(
    job: dict[str, Any], mesh: bytes | None, code: str, timeout: float, memory: float | None
) -> dict[str, Any]:
    """Solve `job` on this worker.

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

    Returns
    -------
    dict
        ``ending`` (fields of `Ending`) and ``files`` (name to bytes); or ``refused`` with the
        reason.
    """
    if (here := code_of_solver(job["solver"])) != code:
        reason = f"the worker has other code or other versions ({here}, the run has {code})"
        return {"refused": f"{reason}: install the same on it"}
    worker = _this_worker()
    limit = memory or 0.8 * provenance()["memory"] / max(1, worker.state.nthreads)
    with tempfile.TemporaryDirectory(prefix="verify-worker-") as place:
        folder = Path(place)
        if mesh is not None:
            _take_along(job, mesh, folder)
        write_json(job, folder / "job.json")
        child = Child(
            "verify.runner.solve",
            folder / "job.json",
            folder / "log.txt",
            timeout,
            limit,
            job.get("ranks", 1),
        )
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
    return {"ending": ending, "files": files}


def _sign(outcome: Path) -> None:
    """Note the worker's machine: its times are not those of the machine of the run."""
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


def _watched(child: Child, worker: Any) -> dict[str, Any]:
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
    if ending is None:
        return {"returncode": -9, "wall": 0.0, "peak": child.peak, "killed_for": "cancelled"}
    return dict(vars(ending))


def _this_worker() -> Any:
    from distributed import get_worker

    return get_worker()

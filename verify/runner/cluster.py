"""Solves on the workers of a Dask cluster: ``verify run --cluster ADDRESS``.

The scheduler hands solves out, restarts those whose worker died, and waits for workers that are
to come. Each worker must have the same code and versions; a solve comes back as bytes. The
comparison stays on the machine of the run.
"""

import logging
import re
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.runner.child import Ending
from verify.runner.fingerprint import code_of_solver
from verify.runner.remote import solve_remotely
from verify.scene import MeshFile, mesh_path, restore_scene
from verify.whole_files import write_whole

_CONNECT_SECONDS = 15.0


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
        mesh = mesh_path(scene).read_bytes() if isinstance(scene.geometry, MeshFile) else None
        future = self._client.submit(
            solve_remotely,
            job,
            mesh,
            code_of_solver(job["solver"]),
            self._timeout,
            self._memory,
            pure=False,
        )
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
        answer = self._future.result()
        if "refused" in answer:
            return self._lost(answer["refused"])
        files: dict[str, bytes] = answer["files"]
        # the outcome last: its presence means that the rest is there
        for name in sorted(files, key=lambda name: name == "outcome.json"):
            write_whole(self._folder / Path(name).name, files[name])
        self._future.release()
        return Ending(**answer["ending"])

    def kill(self) -> None:
        """Cancel it; its worker kills the child within a second or so."""
        self._future.cancel(force=True)

    def _lost(self, reason: Any) -> Ending:
        text = str(reason).splitlines()[0] if str(reason) else type(reason).__name__
        if type(reason).__name__ == "KilledWorker":
            text = "the workers that ran it died, several times over"
        self.log.write_text(f"{text}\n", encoding="utf-8")
        return Ending(1, 0.0, 0.0)

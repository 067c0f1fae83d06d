"""A solve on several MPI ranks of one machine: ``python -m verify.runner.ranks N MODULE JOB``.

Turns itself into mpiexec, which starts N times ``python -m MODULE JOB``. MPI programs find each
other only if mpiexec and mpi4py belong to the same MPI: each rank counts them before it works.
"""

import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any, NoReturn

from verify.errors import InputError
from verify.files import write_json
from verify.processes import die_with_parent, under_a_launcher

RANKS_VARIABLE = "VERIFY_RANKS"
#: The ranks stay on this machine, whatever a batch system would have mpiexec do. One that waits
#: sleeps: where others want its core, each message of MPICH takes a time slice of theirs else.
AT_HOME = {
    "HYDRA_RMK": "user", "HYDRA_LAUNCHER": "fork", "MPIR_CVAR_CH4_PROGRESS_THROTTLE": "1",
}  # fmt: skip
_WAIT_SECONDS = 2.0


def mpiexec() -> str:
    """Return the path of mpiexec: that beside this Python, or else the first in the path.

    Raises
    ------
    InputError
        If there is none.
    """
    beside = Path(sys.executable).with_name("mpiexec")
    if (found := str(beside) if beside.exists() else shutil.which("mpiexec")) is None:
        text = "needs mpiexec, which is neither beside this Python nor in the path"
        raise InputError(text, "--ranks")
    return found


def main(count: int, module: str, argument: str) -> NoReturn:
    """Become mpiexec."""
    die_with_parent()  # holds after exec
    under_a_launcher()
    here = {**AT_HOME, RANKS_VARIABLE: str(count)}
    flags = ["-P", "-X", "faulthandler", "-m", module, argument]
    command = [mpiexec(), "-n", str(count), sys.executable, *flags]
    os.execve(command[0], command, {**os.environ, **here})


def world() -> Any:
    """Return the communicator of all ranks, or None where there is only this process.

    Raises
    ------
    InputError
        If the ranks do not find each other.
    """
    wanted = int(os.environ.get(RANKS_VARIABLE, "1"))
    if wanted == 1:
        return None
    from reference.installation import all_ranks

    ranks, vendor = all_ranks()
    if ranks.size != wanted:
        raise InputError(
            f"mpiexec started {wanted} processes of which each finds {ranks.size}: it is of "
            f"another MPI than mpi4py ({vendor})",
            "--ranks",
        )
    return ranks


def give_up(comm: Any, outcome: dict[str, Any], file: Path) -> None:
    """End all ranks: one has failed, and the others may wait for it for ever.

    What the first rank says counts, if it says anything within a moment; else what this one does.
    """
    end = time.monotonic() + _WAIT_SECONDS
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.02)
    if not file.exists():
        write_json({**outcome, "reason": f"{outcome['reason']} (on rank {comm.rank})"}, file)
    comm.Abort(1)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3])

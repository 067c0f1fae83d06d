"""Options of a run, apart from the cases."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

_PATHS = ("cache", "references")


@dataclass(frozen=True)
class Options:
    """Options of a run.

    Parameters
    ----------
    solvers : tuple of str
        The solvers compared; empty: those that the case's acceptance names, with ``xfem`` and
        ``conforming``. The conforming reference of a case without exact solution runs in any
        case.
    repetitions : int
        Timed repetitions of each solve, after the first call, which compiles.
    parameters : dict of str to dict
        Parameters by solver.
    jobs : int
        Processes at the same time.
    timeout : float
        Wall seconds after which a solve is killed.
    memory : float or None
        Bytes of resident memory above which a solve is killed; default: 80 % of the machine's,
        shared by `jobs`.
    cache : Path or None
        Folder of references that were solved before; None: every run solves its own.
    references : Path or None
        A bundle of references, which judges instead of solving any.
    cluster : str or None
        Scheduler of a Dask cluster whose workers solve; None: processes of this machine do.
    ranks : int
        MPI ranks of each reference.
    judge_only : tuple of str
        Solvers that are judged; empty: all that are asked and do not refuse the case.
    judged : bool
        Whether the references that judge are solved with the rest; without them only `solvers` run.
    """

    solvers: tuple[str, ...] = ()
    repetitions: int = 3
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    jobs: int = 1
    timeout: float = 600.0
    memory: float | None = None
    cache: Path | None = None
    references: Path | None = None
    cluster: str | None = None
    ranks: int = 1
    judge_only: tuple[str, ...] = ()
    judged: bool = True

    def of_result(self) -> dict[str, Any]:
        """Return those that change what is computed; a resumed run must have the same."""
        return {
            "solvers": list(self.solvers),
            "repetitions": self.repetitions,
            "parameters": self.parameters,
        }

    def record(self) -> dict[str, Any]:
        """Return all of them as plain values."""
        paths = {name: str(v) if (v := getattr(self, name)) else None for name in _PATHS}
        names = {"solvers": list(self.solvers), "judge_only": list(self.judge_only)}
        return {**asdict(self), **paths, **names}

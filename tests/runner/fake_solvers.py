"""Solvers for the runner's tests, named ``fake_solvers:Class`` on the command line.

Each solves nothing: it returns a linear field on a square of triangles at once, or dies in the
way that its name says.
"""

import os
import signal
import sys
import time
from pathlib import Path
from types import MappingProxyType

import numpy as np

from verify.errors import UnsupportedSceneError
from verify.solution import Solution


class Instant:
    """Returns u = (strain·x, 0) on the unit square; counts its calls in a file if asked to."""

    name = "instant"
    strain = 0.1

    def refuses(self, scene):
        return None

    def levels(self, scene):
        return scene.mesh.count

    def solve(self, scene, level, repetitions=1, **parameters):
        if counter := os.environ.get("COUNT_SOLVES"):
            with Path(counter).open("a") as stream:
                stream.write(f"{scene.name} {self.name} {level}\n")
        return self.field(2 << level, repetitions)

    def field(self, n, repetitions):
        x, y = np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2)
        points = np.column_stack([x.ravel(), y.ravel()])
        first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
        right, up, far = first + 1, first + n + 1, first + n + 2
        cells = np.vstack([np.column_stack([first, right, far]), np.column_stack([first, far, up])])
        displacement = np.zeros((1, len(points), 2))
        displacement[0, :, 0] = self.strain * points[:, 0]
        threads = os.environ["OMP_NUM_THREADS"]
        return Solution(
            points=points,
            cells=cells,
            displacement=displacement,
            unknowns=2 * len(points),
            size=1 / n,
            timings={"solve": [1e-3] * repetitions},
            notes={"threads": threads},
        )


class Straining(Instant):
    """Stretches by its parameter."""

    choices = MappingProxyType({"way": ("along", "across")})

    def solve(self, scene, level, repetitions=1, strain=0.1, way="along"):
        self.strain = strain
        return super().solve(scene, level, repetitions)


class Wrong(Instant):
    """Stretches twice as much as it should."""

    strain = 0.2


class Refusing(Instant):
    def refuses(self, scene):
        return "it only does beams"


class RefusingLate(Instant):
    def solve(self, scene, level, repetitions=1, **parameters):
        raise UnsupportedSceneError("it found a knot")


class Raising(Instant):
    def solve(self, scene, level, repetitions=1, **parameters):
        raise ZeroDivisionError("the pivot is zero")


class Crashing(Instant):
    def solve(self, scene, level, repetitions=1, **parameters):
        os.kill(os.getpid(), signal.SIGSEGV)


class Leaving(Instant):
    def solve(self, scene, level, repetitions=1, **parameters):
        print("some banner\n[0]PETSC ERROR: zero pivot in row 7\nend of output", file=sys.stderr)
        sys.stderr.flush()
        os._exit(59)


class NotFinite(Instant):
    strain = float("nan")


class Hanging(Instant):
    """Hangs, with a child of its own that hangs too."""

    def solve(self, scene, level, repetitions=1, **parameters):
        if os.fork() == 0:
            time.sleep(600)
        Path(os.environ.get("HANG_MARK", os.devnull)).write_text(str(os.getpid()))
        time.sleep(600)


class Hungry(Instant):
    def solve(self, scene, level, repetitions=1, **parameters):
        hoard = []
        while True:
            hoard.append(np.ones(2_000_000))  # 16 MB, touched
            time.sleep(0.005)


class HangingOnLevelOne(Instant):
    """Solves level 0; on level 1 says so in a file and hangs until the file is gone."""

    def solve(self, scene, level, repetitions=1, **parameters):
        mark = os.environ.get("HANG_MARK")
        if level == 1 and mark:
            Path(mark).write_text(str(os.getpid()))
            time.sleep(600)
        return super().solve(scene, level, repetitions)


class Brittle(Instant):
    def __init__(self):
        raise RuntimeError("no licence")


class HangingOnce(Instant):
    """Hangs on level 1 the first time, and says so in a file; solves it the second time."""

    def solve(self, scene, level, repetitions=1, **parameters):
        mark = Path(os.environ["HANG_MARK"])
        if level == 1 and not mark.exists():
            mark.write_text(str(os.getpid()))
            time.sleep(600)
        return super().solve(scene, level, repetitions)


class FailingOnOneRank(Instant):
    """The second MPI rank fails; the first waits for it for ever."""

    def solve(self, scene, level, repetitions=1, **parameters):
        from mpi4py import MPI

        if MPI.COMM_WORLD.rank == 1:
            raise ZeroDivisionError("the pivot is zero")
        MPI.COMM_WORLD.Barrier()

"""Guests that misbehave, named ``guests:Class`` on the command line.

Each is asked, solves or answers in the way that its name says.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from fake_solvers import Instant

from verify.errors import InputError


class Guest(Instant):
    def levels(self, scene):
        return 1

    def solve(self, scene, level, repetitions=1, **parameters):
        return self.spoilt(super().solve(scene, level, repetitions))

    def spoilt(self, solution):
        return solution


def left(name):
    """Where a guest leaves a sign, for the test to see."""
    return Path(os.environ["GUEST_SIGNS"], name)


# what it answers


class Nothing(Guest):
    def spoilt(self, solution):
        return None


class Text(Guest):
    def spoilt(self, solution):
        return "solved"


class Lying(Guest):
    """An object with the attributes of a solution, which is none."""

    def spoilt(self, solution):
        return type("Solution", (), {**vars(solution), "__len__": lambda self: 1 / 0})()


class Spoiling(Guest):
    """Spoils the arrays of a solution after it was checked."""

    def spoilt(self, solution):
        solution.displacement[0, 3] = np.nan
        return solution


class Huge(Guest):
    def spoilt(self, solution):
        return replace(solution, displacement=np.full_like(solution.displacement, 1e300))


class Large(Guest):
    """As large as can be handed over."""

    def spoilt(self, solution):
        return replace(solution, displacement=np.full_like(solution.displacement, 1e99))


class Collapsed(Guest):
    def spoilt(self, solution):
        return replace(solution, cells=solution.cells * 0)


class Negative(Guest):
    def spoilt(self, solution):
        return replace(solution, size=-1.0, unknowns=-5)


class InSpace(Guest):
    """A whole solution, in another dimension than the case."""

    def spoilt(self, solution):
        points = np.column_stack([solution.points, np.zeros(len(solution.points))])
        return replace(solution, points=points, displacement=np.zeros((1, *points.shape)))


class TinySize(Guest):
    """States an element size that would take the comparison for ever."""

    def spoilt(self, solution):
        return replace(solution, size=1e-12)


class HugeSize(Guest):
    def spoilt(self, solution):
        return replace(solution, size=1e30)


class Twice(Guest):
    """Covers the body twice."""

    def spoilt(self, solution):
        return replace(solution, cells=np.vstack([solution.cells, solution.cells]))


class FarAway(Guest):
    def spoilt(self, solution):
        return replace(solution, points=solution.points + 10.0)


class Needle(Guest):
    """One cell from here to far away, the others where they should be."""

    def spoilt(self, solution):
        points = solution.points.copy()
        points[-1] = 1e90
        return replace(solution, points=points)


class Escaping(Guest):
    """Names and words that would colour the terminal and end its line."""

    def solve(self, scene, level, repetitions=1, **parameters):
        raise ValueError("\x1b[31mred\x1b]0;title\x07\nsecond line " + "x" * 10_000_000)


class Unspeakable(Guest):
    """An error that cannot be written."""

    def solve(self, scene, level, repetitions=1, **parameters):
        class Mute(BaseException):
            def __str__(self):
                raise RuntimeError("no")

        raise Mute


class Exiting(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        sys.exit(0)


class Interrupting(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        raise KeyboardInterrupt


class Recursive(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        return self.solve(scene, level)


# what it says when it is asked


class TextLevels(Guest):
    def levels(self, scene):
        return "3"


class NoLevels(Guest):
    def levels(self, scene):
        return 0


class NegativeLevels(Guest):
    def levels(self, scene):
        return -3


class EndlessLevels(Guest):
    def levels(self, scene):
        return 10**9


class TrueRefusal(Guest):
    def refuses(self, scene):
        return True


class RaisingRefusal(Guest):
    def refuses(self, scene):
        raise SystemExit("not today")


class Blaming(Guest):
    """Says that the case is bad, which the others solve."""

    def refuses(self, scene):
        raise InputError("its mesh has a hole", "body.msh")


class Undecided(Guest):
    def refuses(self, scene):
        time.sleep(1000)


class DyingRefusal(Guest):
    def refuses(self, scene):
        os._exit(0)


# what it does to its process and to others


class Elsewhere(Guest):
    """Changes the working directory, the environment, the signal handlers."""

    def solve(self, scene, level, repetitions=1, **parameters):
        solution = super().solve(scene, level, repetitions)
        os.chdir("/")
        os.environ.clear()
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        return solution


class Quitting(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        os._exit(0)


class Silent(Guest):
    """Closes what it was to speak through, then fails."""

    def solve(self, scene, level, repetitions=1, **parameters):
        sys.stdout.close()
        sys.stderr.close()
        os.close(1)
        os.close(2)
        raise ZeroDivisionError("the pivot is zero")


class Talkative(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        line = b"y" * 2**20 + b"\n"
        for _ in range(300):
            os.write(1, line)
        return super().solve(scene, level, repetitions)


class Stopping(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        os.kill(os.getpid(), signal.SIGSTOP)


class Killed(Guest):
    """Killed as if from outside."""

    def solve(self, scene, level, repetitions=1, **parameters):
        os.kill(os.getpid(), signal.SIGKILL)


class Leaving(Guest):
    """Starts a process in a session of its own, and an orphan, and hangs."""

    def solve(self, scene, level, repetitions=1, **parameters):
        sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
        found = subprocess.Popen(sleep, start_new_session=True)
        start = f"s.Popen({sleep!r}, start_new_session=True, stdout=-3)"
        middle = f"import subprocess as s; print({start}.pid)"
        orphan = subprocess.check_output([sys.executable, "-c", middle], text=True)
        left("pids").write_text(f"{found.pid} {orphan}")
        time.sleep(600)


class Removing(Guest):
    """Removes the records, the scene and its own folder from the run directory."""

    def solve(self, scene, level, repetitions=1, **parameters):
        for name in ("cases", "run.json"):
            path = Path("out", name)
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        return super().solve(scene, level, repetitions)


class Staying(Guest):
    """Answers, and leaves a thread that never ends."""

    def solve(self, scene, level, repetitions=1, **parameters):
        import threading

        threading.Thread(target=time.sleep, args=(1000,)).start()
        return super().solve(scene, level, repetitions)

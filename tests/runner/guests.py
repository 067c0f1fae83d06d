"""Guests that misbehave, named ``guests:Class`` on the command line.

Each is asked, solves or answers in the way that its name says.
"""

import os
import signal
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


# what it answers


class Text(Guest):
    def spoilt(self, solution):
        return "solved"


class Spoiling(Guest):
    """Spoils the arrays of a solution after it was checked."""

    def spoilt(self, solution):
        solution.displacement[0, 3] = np.nan
        return solution


class Large(Guest):
    """As large as can be handed over."""

    def spoilt(self, solution):
        return replace(solution, displacement=np.full_like(solution.displacement, 1e99))


class Collapsed(Guest):
    def spoilt(self, solution):
        return replace(solution, cells=solution.cells * 0)


class InSpace(Guest):
    """A whole solution, in another dimension than the case."""

    def spoilt(self, solution):
        points = np.column_stack([solution.points, np.zeros(len(solution.points))])
        return replace(solution, points=points, displacement=np.zeros((1, *points.shape)))


class TinySize(Guest):
    """States an element size that would take the comparison for ever."""

    def spoilt(self, solution):
        return replace(solution, size=1e-12)


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


class Exiting(Guest):
    def solve(self, scene, level, repetitions=1, **parameters):
        sys.exit(0)


# what it says when it is asked


class TextLevels(Guest):
    def levels(self, scene):
        return "3"


class Talking(Guest):
    def refuses(self, scene):
        return "no " * 2_000_000


class RaisingRefusal(Guest):
    def refuses(self, scene):
        raise SystemExit("not today")


class Blaming(Guest):
    """Says that the case is bad, which the others solve."""

    def refuses(self, scene):
        raise InputError("its mesh has a hole", "body.msh")


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


class Leaving(Guest):
    """Leaves a process behind that has left its group and lost its parent."""

    def solve(self, scene, level, repetitions=1, **parameters):
        mark = Path(os.environ["LEFT_MARK"])
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                mark.write_text(str(os.getpid()))
                time.sleep(600)
            os._exit(0)
        while not (mark.exists() and mark.read_text()):
            time.sleep(0.01)
        return super().solve(scene, level, repetitions)


class Chatty(Guest):
    """Says 80 MB, and waits until most of it is gone."""

    def solve(self, scene, level, repetitions=1, **parameters):
        for _ in range(80):
            os.write(1, b"." * 2**20)
        while os.fstat(1).st_size > 2**25:
            time.sleep(0.01)
        return super().solve(scene, level, repetitions)

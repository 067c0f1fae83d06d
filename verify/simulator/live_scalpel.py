"""A tool that is led by hand: points where it touches the body become a stroke, cut as it goes."""

import numpy as np

from verify.simulator.session import Session
from verify.xfem.arrays import Floats
from verify.xfem.cuts import ToolPath
from verify.xfem.errors import XfemError

_STEP = 0.2  # of the mean edge: nearer points of the hand add nothing to the path


class LiveScalpel:
    """Leads the blade of a session.

    Parameters
    ----------
    session : Session
    depth : float
        How far the blade reaches on either side of the point touched, m; not used in the plane.

    Attributes
    ----------
    finished : list of ToolPath
        The strokes that have been ended.
    """

    def __init__(self, session: Session, depth: float) -> None:
        self.session, self.depth = session, depth
        self.finished: list[ToolPath] = []
        self._first: tuple[Floats, float] | None = None
        self._cutting = False
        mesh = session.stage.mesh
        self._step = _STEP * float(np.linalg.norm(mesh.edge_vectors, axis=2).mean())
        self._last: Floats | None = None

    def touch(self, place: Floats, towards: Floats) -> None:
        """Lead the tool to a place of the uncut body (3,), the blade along `towards` (3,).

        A movement that a blade cannot make (it would turn back on its sweep) ends the stroke and
        begins another.
        """
        space = self.session.stage.mesh.space
        here = np.asarray(place, dtype=float)[:space]
        if self._last is not None and np.linalg.norm(here - self._last) < self._step:
            return
        self._last = here
        blade, time = self._blade(here, towards), self.session.time
        if not self._cutting:
            if self._first is not None:
                self._begin(blade, time)
            else:
                self._first = (blade, time)
            return
        try:
            self.session.cutter.extend(blade[None], [time])
        except XfemError:
            self.lift()
            self._first = (blade, time)

    def lift(self) -> None:
        """End the stroke."""
        if self._cutting:
            self.finished.append(self.session.cutter.strokes[-1].path)
        self._first, self._cutting, self._last = None, False, None

    def _begin(self, blade: Floats, time: float) -> None:
        assert self._first is not None
        start, moment = self._first
        # from before the touch, so that nothing of it lies in the past of the cutter
        self.session.begin(ToolPath(np.stack([start, blade]), [min(moment, time), time]))
        self._cutting = True

    def _blade(self, here: Floats, towards: Floats) -> Floats:
        if len(here) == 2:
            return here[None]
        reach = self.depth * np.asarray(towards, dtype=float) / np.linalg.norm(towards)
        return np.stack([here - reach, here + reach])

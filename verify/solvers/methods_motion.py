"""Motion of a body that another way to cut has cut, or cuts as time goes on."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.methods.catalogue import METHODS
from verify.methods.cut_body import CutBody, make_body
from verify.methods.opening import Seams, seams_of, welded
from verify.solvers.xfem_answer import Answer
from verify.solvers.xfem_motion import Mover
from verify.solvers.xfem_openings import opening_times, seam_times
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.errors import XfemError
from verify.xfem.inherit import ancestors
from verify.xfem.internal_force import InternalForce
from verify.xfem.phantom import PhantomMesh

__all__ = ["MethodMover"]

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]

_WELDED = ("subdivision", "snapping", "snapping_subdivision")
_RULES = {
    **dict.fromkeys(
        _WELDED,
        "facets of the finished mesh, made before the start, when the blade has passed them",
    ),
    **dict.fromkeys(
        ("removal", "removal_refined"), "cells are removed when the blade has crossed them through"
    ),
    "uncut": "never",
}


class MethodMover(Mover):
    """Motion of a body cut by one of the methods.

    Virtual nodes and removal cut again at every opening, what the cuts have opened by then. A
    mesh that is prepared for the whole cut is welded at first, and opens facet by facet.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    parameters : dict
        Its own.
    law : callable
        Internal force of a cut body.
    further parameters
        Those of `Mover`.

    Attributes
    ----------
    final : CutBody
        With all cuts open.
    """

    final: CutBody

    def __init__(
        self,
        method: str,
        parameters: dict[str, Any],
        law: Callable[[CutBody], InternalForce],
        *of_mover: Any,
    ) -> None:
        self.removal = method.startswith("removal")
        super().__init__(*of_mover)
        self._method, self._parameters, self._internal_force = method, parameters, law
        self._bodies: dict[int, CutBody] = {}  # by the identity of their mesh
        self._seams: Seams | None = None
        self._seam_times = np.empty(0)
        self.rule = _RULES.get(method, "cells as a whole, when the blade has crossed them through")

    def run(self, trial: bool) -> Answer:
        """Run from the first to the last output time; `trial` stops after one step."""
        answer = super().run(trial)
        answer.timings["cutting"] = self.timings.pop("enrichment")
        return answer

    def _events(self) -> _Floats:
        self._opening = np.empty((0, 0))
        self.final = self._kept_body(self._made(np.inf))
        if self._method in _WELDED:
            self._seams = seams_of(self.final.phantom)
            self._seam_times = seam_times(self.asked, self.cuts, self._seams.points, self.opens)
            return np.unique(self._seam_times)
        return np.unique(self._opening[~np.isnan(self._opening)])

    def _made(self, time: float) -> CutBody:
        """Make the body that the method cuts as far as the cuts have come at a time."""
        if self._method in (*_WELDED, "uncut"):
            return METHODS[self._method](self.mesh, self.cuts, **self._parameters)

        def opened(cut: PhantomMesh) -> _Bools:
            self._opening = opening_times(self.asked, cut, self.opens)
            return self._opening <= time

        return METHODS[self._method](self.mesh, self.cuts, **self._parameters, opened=opened)

    def _cut_at(self, time: float) -> PhantomMesh:
        if self._seams is not None:
            closed = self._seam_times > time
            if not closed.any():
                return self.final.phantom
            phantom = welded(self.final.phantom, self._seams, closed)
            shown, origin = self.final.conforming, self.final.cell_origin
            body = make_body(self.mesh, phantom, conforming=shown, cell_origin=origin)
            return self._kept_body(body).phantom
        if self._method == "uncut" or not (self._opening > time).any():
            return self.final.phantom
        return self._kept_body(self._made(time)).phantom

    def _kept_body(self, body: CutBody) -> CutBody:
        self._bodies[id(body.phantom)] = body
        return body

    def _law(self, phantom: PhantomMesh) -> InternalForce:
        return self._internal_force(self._bodies[id(phantom)])

    def _inherited(
        self, phantom: PhantomMesh, state: MotionState, further: DynamicBody
    ) -> MotionState:
        source = self._source(phantom, further.force.phantom)
        return MotionState(state.displacement[source], state.velocity[source], state.time)

    def _source(self, old: PhantomMesh, new: PhantomMesh) -> NDArray[np.int64]:
        """Dof node (N,) of an old body from which each of a new one comes, cell by cell."""
        if old is new:
            return np.arange(new.node_count)
        if self._seams is None and self._bodies[id(new)].cell_number is None:
            return ancestors(old, new)
        before, after = (self._bodies[id(one)].cell_number for one in (old, new))
        place = np.arange(len(new.cells))
        if before is not None and after is not None:
            place = np.searchsorted(before, after)
            if not np.array_equal(before[np.minimum(place, len(before) - 1)], after):
                raise XfemError("a cell that was removed as debris is there again later")
        source = np.zeros(new.node_count, dtype=np.int64)
        source[new.cells] = old.cells[place]
        return source

"""The control: finite elements that know of no cut."""

from collections.abc import Sequence

from verify.methods.cut_body import Change, CutBody, make_body
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh


def uncut(mesh: SimplexMesh, cuts: Sequence[Cut]) -> CutBody:
    """Leave the cuts out, and say so."""
    change = Change("cut left out", len(cuts), float("inf") if cuts else 0.0, "m")
    return make_body(mesh, cut_mesh(mesh, []), (change,))

"""All methods by name, and the control that leaves the cuts out."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from verify.methods.cut_body import Change, CutBody, make_body
from verify.methods.removal import removal, removal_refined
from verify.methods.snapping import snapping
from verify.methods.subdivision import snapping_subdivision, subdivision
from verify.methods.virtual_nodes import virtual_node, virtual_node_arbitrary
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh


def uncut(mesh: SimplexMesh, cuts: Sequence[Cut]) -> CutBody:
    """Leave the cuts out, and say so."""
    change = Change("cut left out", len(cuts), float("inf") if cuts else 0.0, "m")
    return make_body(mesh, cut_mesh(mesh, []), (change,))


METHODS: Mapping[str, Callable[..., CutBody]] = {
    "subdivision": subdivision,
    "snapping": snapping,
    "snapping_subdivision": snapping_subdivision,
    "removal": removal,
    "removal_refined": removal_refined,
    "virtual_node": virtual_node,
    "virtual_node_arbitrary": virtual_node_arbitrary,
    "uncut": uncut,
}


def cut_by(method: str, mesh: SimplexMesh, cuts: Sequence[Cut], **parameters: Any) -> CutBody:
    """Cut a mesh by a method of the given name, with its own parameters.

    Raises
    ------
    XfemError
        If there is no such method, or it cannot make this cut.
    """
    if method not in METHODS:
        raise XfemError(f"no method '{method}'; expected one of {', '.join(METHODS)}")
    return METHODS[method](mesh, cuts, **parameters)

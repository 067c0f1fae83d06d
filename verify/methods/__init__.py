"""The other ways to cut a finite element mesh, and others' parts of the method of `verify.xfem`.

A method takes an uncut mesh and cuts and gives a `CutBody`: what to solve on, what to show, how
many unknowns it cost and what it moved, merged or lost. All of them use statics and dynamics of
`verify.xfem`, so that only the cut differs. Read it in this order:

what every method gives
    `cut_body`; here all of them by name
nodes that move onto the cut, and cells that are split along it
    `tip_nodes` (ends of cuts as nodes), `snapping`
cells that go
    `removal`
cells that are copied
    `virtual_nodes`
springs instead of elements
    `springs`
in the place of parts of `verify.xfem`, chosen by its adapter
    `tip_nodes` before the cut, `mass_variants` for the mass, `generalised_alpha` for the steps

Sources and limits of each: ``docs/theory/methods.md``.

Example
-------
>>> from verify.methods import cut_by
>>> from verify.xfem.cuts import Polyline
>>> from verify.xfem.mesh import rectangle_mesh
>>> body = cut_by("snapping", rectangle_mesh((8, 8)), [Polyline([[-1.0, 0.45], [0.5, 0.45]])])
>>> body.counts.nodes - body.counts.nodes_before
4
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from verify.methods.cut_body import Change, Counts, CutBody, make_body
from verify.methods.removal import removal, removal_refined
from verify.methods.snapping import snapping, snapping_subdivision, subdivision
from verify.methods.virtual_nodes import virtual_node, virtual_node_arbitrary
from verify.xfem.arrays import XfemError
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh

__all__ = ["METHODS", "Change", "Counts", "CutBody", "cut_by"]


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

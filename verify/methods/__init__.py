"""The other ways to cut a finite element mesh, and others' parts of the method of `verify.xfem`.

A method takes an uncut mesh and cuts and gives a `CutBody`: what to solve on, what to show, how
many unknowns it cost and what it moved, merged or lost. Statics and dynamics are those of
`verify.xfem` for all of them, so that only the cut differs. Read it in this order:

what every method gives
    `cut_body`, `catalogue` (all methods by name)
nodes that move onto the cut
    `feet`, `nodal_cut`, `snapped_mesh`, `snapping`
cells that are split
    `tip_nodes` (ends of cuts as nodes), `opened_mesh`, `subdivision`
cells that go
    `refinement`, `removal`
cells that are copied
    `virtual_nodes`
springs instead of elements
    `spring_fit`, `spring_kernels`, `spring_force`
in the place of parts of `verify.xfem`, chosen by its adapter
    `tip_nodes` before the cut, `mass_variants` for the mass, `generalised_alpha` for the steps

Sources and limits of each: ``docs/theory/methods.md``.

Example
-------
>>> from verify.methods.catalogue import cut_by
>>> from verify.xfem.cuts import Polyline
>>> from verify.xfem.structured_meshes import rectangle_mesh
>>> body = cut_by("snapping", rectangle_mesh((8, 8)), [Polyline([[-1.0, 0.45], [0.5, 0.45]])])
>>> body.counts.nodes - body.counts.nodes_before
4
"""

from verify.methods.catalogue import METHODS, cut_by
from verify.methods.cut_body import Change, Counts, CutBody

__all__ = ["METHODS", "Change", "Counts", "CutBody", "cut_by"]

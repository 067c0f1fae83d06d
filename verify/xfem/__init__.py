"""Compact XFEM solver for cutting soft tissue: arrays in, arrays out.

It knows no scene, no file format and no other solver, and needs numpy, scipy and numba only.
Read it in this order:

geometry of a cut
    `mesh`, `structured_meshes`; `cuts`, `polyline`, `surface_cut`
what a cut does to a mesh
    `clipping`, `zero_points`, `split` (pieces), `joining` (which share unknowns), `virtual` (the
    result: standard finite elements with weights), `subdivision` (a conforming mesh of it)
slivers
    `slivers` (policies), `piece_contacts`, `absorption`; `ghost_penalty`
mechanics
    `elasticity`, `stiffness`, `loads`, `supports`, `static`; `bases`, `thesis_blocks`
linear algebra
    `block_pattern`; `minimum_degree`, `front_tree`, `cholesky`; `conjugate_gradients`

Example
-------
A clamped plate, cut half through, under its own weight:

>>> from verify.xfem.structured_meshes import rectangle_mesh
>>> from verify.xfem.polyline import Polyline
>>> from verify.xfem.virtual import cut_mesh
>>> from verify.xfem.elasticity import isotropic
>>> from verify.xfem.supports import Supports
>>> from verify.xfem.loads import body_force
>>> from verify.xfem.static import solve_static
>>> virtual = cut_mesh(rectangle_mesh((8, 8)), [Polyline([[-1.0, 0.45], [0.5, 0.45]])])
>>> top = virtual.mesh.points[:, 1] > 0.999
>>> held = Supports.none(virtual).prescribe(virtual, top)
>>> solution = solve_static(
...     virtual, isotropic(1e4, 0.3, "plane strain"), held, body_force(virtual, [0.0, -9.8e3])
... )
>>> bool(solution.residual < 1e-12)
True
"""

from verify.xfem.errors import XfemError

__all__ = ["XfemError"]

"""Compact XFEM solver for cutting soft tissue: arrays in, arrays out.

It knows no scene, no file format and no other solver, and needs numpy, scipy and numba only.
Its parts are layers (`make check` tests that none imports one above it). In an order of
reading:

`mesh`, `structured_meshes`
    simplices
`cuts`, `faceted_cuts`, `tool_path`
    what a cut is: flat, a polyline, a triangulated surface, what a tool sweeps
`zero_points`, `clip`, `crossing`, `pieces`
    exact division of cells at zero points of level sets; parts of the cells that cuts go through
`join`, `phantom`
    which parts share dof nodes (by contact across faces), on which side of the cuts they lie, and
    the result: standard finite elements with weights
`elasticity`, `loads`, `supports`, `mass`
    material, load vectors, prescribed displacements; masses, side-wise and consistent
`polar`, `element`, `block_pattern`, `internal_force`
    nearest rotations; force and tangents of an element, linear elasticity being R = I; sparsity
    and supports; force, energy and stiffness of a body
`linear_solvers`
    SciPy behind one protocol, and the operations that `verify.accelerated` replaces
`statics`, `static_newton`, `rigid_motion`, `equilibrium`
    linear statics; Newton's method on the potential energy and load steps at finite rotation
`body`, `energy_balance`, `explicit`, `implicit`, `energy_momentum`, `real_time`, `inherit`
    a body in motion, its energies and its schemes; the state of a body that is cut on the way
`contacts`, `aggregation`, `slivers`, `ghost_penalty`
    policies for parts with a small share of their element
`bases`, `critical_step`, `subdivision`
    other bases of the same space; largest step of explicit schemes; the cut body as a conforming
    mesh
`errors`
    what is raised, and checks of what a user gives

Example
-------
A clamped plate, cut half through, under its own weight:

>>> from verify.xfem.structured_meshes import rectangle_mesh
>>> from verify.xfem.cuts import Polyline
>>> from verify.xfem.phantom import cut_mesh
>>> from verify.xfem.elasticity import isotropic
>>> from verify.xfem.supports import Supports
>>> from verify.xfem.loads import body_force
>>> from verify.xfem.statics import solve_static
>>> phantom = cut_mesh(rectangle_mesh((8, 8)), [Polyline([[-1.0, 0.45], [0.5, 0.45]])])
>>> top = phantom.mesh.points[:, 1] > 0.999
>>> held = Supports.none(phantom).prescribe(phantom, top)
>>> solution = solve_static(
...     phantom, isotropic(1e4, 0.3, "plane strain"), held, body_force(phantom, [0.0, -9.8e3])
... )
>>> bool(solution.residual < 1e-12)
True
"""

from verify.xfem.errors import XfemError

__all__ = ["XfemError"]

"""Compact XFEM solver for cutting soft tissue: arrays in, arrays out.

It knows no scene, no file format and no other solver, and needs numpy, scipy and numba only.
Alternatives of other authors are in `verify.methods`. Numbers in brackets such as (2.48) are
equations of the thesis that ``docs/theory/xfem.md`` cites. The page derives the space; equations of
division, force, Newton's method and schemes are in the docstrings of their modules.

What a user calls, each with an example in its docstring, is in this package itself:

mesh
    `SimplexMesh`, `rectangle_mesh`, `box_mesh`
cut
    `Plane`, `Polyline`, `TriangulatedSurface`; `cut_mesh`, `treat_slivers`; `subdivide` for a
    conforming mesh of the result
pose
    `isotropic`, `Supports`, `body_force`, `traction`
statics
    `solve_static` in linear kinematics, `static_equilibrium` at finite rotation
motion
    `InternalForce` and `side_wise_mass` make a `DynamicBody`; `CentralDifferences` and
    `EnergyMomentum` are schemes, `run` takes steps, `critical_step` limits the steps of the first

Example
-------
A clamped plate, cut half through, under its own weight:

>>> import verify.xfem as xfem
>>> cut = xfem.Polyline([[-1.0, 0.45], [0.5, 0.45]])
>>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((8, 8)), [cut])
>>> held = xfem.Supports.none(phantom).prescribe(phantom, phantom.mesh.points[:, 1] > 0.999)
>>> material = xfem.isotropic(1e4, 0.3, "plane strain")
>>> weight = xfem.body_force(phantom, [0.0, -9.8e3])
>>> solution = xfem.solve_static(phantom, material, held, weight)
>>> bool(solution.residual < 1e-12)
True

Words that docstrings take for granted:

cell, element
    a simplex of the uncut mesh
face, facet
    a *face* is a side that two cells share: a segment (2D) or triangle (3D). A *facet* is any side,
    as on the boundary or of a sub-simplex, or one of the segments or triangles of a cut
level set, depth, extent
    of a cut: signed distance from it; distance inward from its ends; where that is positive
    (docstring of `cuts`). But ``mesh.extent`` is the size of the mesh
realised cut
    the zero set of the level set as the mesh interpolates it, in the cells that the cut splits
zero point
    where the level set of a cut, linear on an edge, is zero
piece
    what the cuts leave of a cell on one side; a cell that no cut splits is one piece. Its *label*
    tells the side of each cut (±1), 0 where the cut does not split it. The label is geometry; dof
    nodes alone tell which pieces are connected
part
    the pieces of a cell that share all dof nodes. Cuts that end on one another leave such pieces,
    and so does a cut through a single cell
solid
    of pieces: more than round-off of their cell (of bodies and materials: not a membrane)
dof node, unknown
    one displacement vector. A node of the mesh has one for each piece of material around it that
    the cuts keep apart: the first n are the mesh nodes, the others are phantom nodes. These are the
    *side-wise* unknowns; an enrichment has u and a in their place
free body
    pieces connected by shared dof nodes; a cut through the whole makes two of one
share, fraction
    without further words, of the volume of a cell
fixed, held
    a component of a dof node is *fixed* if supports prescribe it; a node or body that such
    components keep in place is *held*
sliver
    a piece with a small share in the volume of its cell
corner
    a node of a piece. It is a dof node, unless slivers are aggregated: then some corners *follow*
    the linear field of a *root*, a piece that is no sliver, and have no unknown of their own. On a
    first reading take ``corners``, ``extend``, ``restrict``, ``unfold`` and ``fold`` for identities
membrane
    triangles in space, without bending stiffness

Shapes of arrays: n nodes, m cells, p pieces, N dof nodes, B blocks of a matrix; other letters only
tell which lengths are equal. Points and displacements have d components, cells d + 1 corners; of a
membrane, points have 3 components and cells 3 corners. Kernels for all of them count corners by c.
Units are SI; in the plane they are per metre of thickness.

The modules in an order of reading; each imports only modules before it. The exception is `cuts`,
which re-exports `faceted_cuts` and is easier read first:

`arrays`, `mesh`
    types of arrays, checks of arguments, exceptions; simplices, their neighbours and gradients
`cuts`, `faceted_cuts`
    what a cut is: a plane or polygon, what a tool sweeps, a polyline, a triangulated surface. The
    solver asks a cut two things only
`zero_points`, `clip`, `crossing`, `pieces`
    exact division of cells at zero points of level sets; which cells a cut goes through; junctions,
    where cuts end on one another. Begin with the docstring of `pieces`, which says what the others
    are for; leave the junctions out at first
`join`, `phantom`
    which pieces share dof nodes (by contact across faces), and on which side of the cuts pieces and
    dof nodes lie; the result: standard finite elements with weights
`polar`, `element`, `hyperelastic`, `loads_and_supports`
    nearest rotations; material, force and tangents of an element, linear elasticity being R = I;
    load vectors, prescribed displacements
`block_pattern`, `linear_solvers`, `mass`, `internal_force`
    sparsity and supports in a matrix; SciPy behind one protocol, and the operations that
    `verify.accelerated` replaces; masses, side-wise and consistent; force, energy and stiffness of
    a body
`statics`
    linear; Newton's method with a line search on the potential energy
`body`, `explicit`, `implicit`
    a body in motion, and its schemes

Extensions, to be skipped at first: none of the modules above needs them (a contract of the imports
holds that). Two functions of the package lead there. ``static_equilibrium`` is ``LoadPath.follow``:
for each step ``RigidMotions.follow``, then ``Newton.solve``. ``EnergyMomentum`` inherits its
``step`` from ``NewtonIntegrator`` in `implicit`, with another force and matrix.

`contacts`, `aggregation`, `slivers`, `ghost_penalty`
    which pieces touch; corners that follow others, u = C û; policies for slivers; a penalty on them
`rigid_motion`, `equilibrium`
    load steps at finite rotation: rigid motion first, second paths, stability, slack membranes
`energy_balance`, `energy_momentum`, `real_time`, `release`
    energies of a motion; a scheme that keeps energy and momentum; one with a single linear solve
    per step; the state of a body that is cut on the way, and the tie forces behind the cut
`subdivision`
    the cut body as a conforming mesh
`closing`, `turning_faces`
    contact of the faces of cuts; at finite rotation
"""

from verify.xfem.arrays import XfemError
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane, Polyline, TriangulatedSurface
from verify.xfem.element import isotropic
from verify.xfem.energy_balance import run
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.explicit import CentralDifferences, critical_step
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports, body_force, traction
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.slivers import treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import subdivide

__all__ = [
    "CentralDifferences",
    "DynamicBody",
    "EnergyMomentum",
    "InternalForce",
    "Plane",
    "Polyline",
    "SimplexMesh",
    "Supports",
    "TriangulatedSurface",
    "XfemError",
    "body_force",
    "box_mesh",
    "critical_step",
    "cut_mesh",
    "isotropic",
    "rectangle_mesh",
    "run",
    "side_wise_mass",
    "solve_static",
    "static_equilibrium",
    "subdivide",
    "traction",
    "treat_slivers",
]

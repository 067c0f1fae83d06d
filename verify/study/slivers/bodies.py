"""The bodies of the sweep: a unit square or cube whose cut comes ever nearer to its nodes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, identity

from reference.meshing import imprint, open_cut
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import Material, isotropic
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.mesh import SimplexMesh
from verify.xfem.slivers import treat_slivers
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.subdivision import subdivide
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = [
    "DENSITY",
    "TREATMENTS",
    "Placement",
    "SweptBody",
    "background",
    "soft",
    "swept_body",
    "uncut_body",
]

Placement = Literal["along faces", "along edges", "through vertices"]

TREATMENTS = ("keep", "drop", "merge", "ghost penalty", "conforming", "conforming snapped")
YOUNG, POISSON, DENSITY = 1e4, 0.3, 1000.0  # the thesis' soft tissue, SI units
_SNAP = 0.25  # element sizes: nodes as near as that to the cut are moved onto it
_ON = 1e-10  # edges: the mesh generator takes nodes as near as that to lie on the cut
_NORMALS = {  # in the plane without the second component; what contains which nodes for ε = 0
    "along faces": (0.0, 0.0, 1.0),
    "along edges": (-1 / 3, 0.0, 1.0),
    "through vertices": (-1 / 3, -1 / 5, 1.0),
}
_Floats = NDArray[np.float64]


def soft(dimension: int, young: float = YOUNG) -> Material:
    """Material of the sweep: plane strain in 2D."""
    return isotropic(young, POISSON, "plane strain" if dimension == 2 else "solid")


def background(dimension: int, quick: bool = False) -> SimplexMesh:
    """Uncut mesh: 8 × 8 squares with alternating diagonals, the first falling; or a small box."""
    if dimension == 3:
        return box_mesh((2, 2, 4) if quick else (3, 3, 4))
    rising, falling = (rectangle_mesh((8, 8), diagonal=d) for d in ("right", "left"))
    odd = (np.indices((8, 8)).sum(axis=0) % 2 == 1)[:, :, None, None]
    halves = [mesh.cells.reshape(8, 8, 2, 3) for mesh in (rising, falling)]
    return SimplexMesh(rising.points, np.where(odd, *halves).reshape(-1, 3))


@dataclass(frozen=True)
class SweptBody:
    """A body with one cut, after the treatment of its slivers.

    Attributes
    ----------
    dimension, placement, size, treatment
        As in `verify.study.slivers.measurement.Measurement`.
    virtual : VirtualMesh
        What is computed on; a conforming mesh has no cut any more.
    untreated : VirtualMesh
        Before the sliver policy.
    extension : (N_untreated, N) csr_array
        Untreated unknowns from treated ones.
    ghost : GhostPenalty or None
    cut : Plane
        As asked.
    """

    dimension: int
    placement: str
    size: float
    treatment: str
    virtual: VirtualMesh
    untreated: VirtualMesh
    extension: csr_array
    ghost: GhostPenalty | None
    cut: Plane

    @cached_property
    def node_above(self) -> NDArray[np.bool_]:
        """(N,) whether the material of each unknown lies above the cut."""
        above: NDArray[np.bool_] = self.cut.level_set(self.virtual.node_piece_points) > 0.0
        return above

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """(N, d) both faces across the cut clamped."""
        last = self.virtual.node_points[:, -1]
        ends = (last < 1e-9) | (last > 1.0 - 1e-9)
        return np.repeat(ends[:, None], self.dimension, axis=1)


def swept_body(mesh: SimplexMesh, placement: Placement, size: float, treatment: str) -> SweptBody:
    """Cut a mesh `size` element sizes away from its nodes and treat the slivers.

    Raises
    ------
    ValueError
        If the treatment is unknown, or the conforming mesh does not exist (a cell without area).
    """
    if treatment not in TREATMENTS:
        raise ValueError(f"treatment '{treatment}'; expected one of {', '.join(TREATMENTS)}")
    dim = mesh.dim
    up = np.eye(dim)[-1]
    normal = np.array(_NORMALS[placement])[[0, -1] if dim == 2 else [0, 1, 2]]
    layer = 1.0 / (8.0 if dim == 2 else 4.0)
    corner = np.full(dim, 0.5)
    if placement != "along faces":
        # the node nearest to the middle, whatever the number of divisions
        nearest = np.linalg.norm(mesh.points - corner, axis=1).argmin()
        corner = mesh.points[nearest]
    cut = Plane(corner + size * layer * up, normal)
    cut_body = cut_mesh(mesh, [cut])
    whole = SweptBody(
        dim, placement, size, treatment, cut_body, cut_body,
        csr_array(identity(cut_body.node_count)), None, cut,
    )  # fmt: skip
    if treatment == "ghost penalty":
        return replace(whole, ghost=GhostPenalty(cut_body, soft(dim)))
    if treatment in ("drop", "merge"):
        treated, report = treat_slivers(cut_body, treatment)  # type: ignore[arg-type]
        return replace(whole, virtual=treated, extension=report.absorption.extension)
    if treatment == "keep":
        return whole
    source = _snapped(mesh, cut, _SNAP * layer) if treatment == "conforming snapped" else mesh
    opened = cut_mesh(_conforming(source, cut), [])
    return replace(
        whole, virtual=opened, untreated=opened, extension=csr_array(identity(opened.node_count))
    )


def uncut_body(mesh: SimplexMesh) -> SweptBody:
    """Return the body without a cut, to compare with."""
    beside = swept_body(mesh, "along faces", 0.0, "keep")
    whole = cut_mesh(mesh, [])
    extension = csr_array(identity(whole.node_count))
    return replace(
        beside, virtual=whole, untreated=whole, extension=extension, placement="uncut",
        treatment="uncut",
    )  # fmt: skip


def _snapped(mesh: SimplexMesh, cut: Plane, reach: float) -> SimplexMesh:
    """Move the nodes within reach of the cut onto it, along the last axis."""
    height = cut.level_set(mesh.points)
    slope = cut.level_set(mesh.points + np.eye(mesh.dim)[-1]) - height
    points = mesh.points.copy()
    near = np.abs(height) <= reach
    points[near, -1] -= (height / slope)[near]
    return SimplexMesh(points, mesh.cells)


def _conforming(mesh: SimplexMesh, cut: Plane) -> SimplexMesh:
    """Split the cells that are cut, and open the cut."""
    if mesh.dim == 2:  # by the reference's own code, which shares nothing with the solver's
        height = np.abs(cut.level_set(mesh.points)) / np.linalg.norm(mesh.edge_vectors[0, 0])
        if ((height > 1e-4 * _ON) & (height <= _ON)).any():
            raise ValueError(
                f"nodes lie {height[height > 1e-4 * _ON].min():.1e} edges from the cut: the mesh "
                "generator takes them to lie on it, and makes a mesh of another cut"
            )
        ends = np.array([[-1.0, 0.0], [2.0, 0.0]])
        rise = cut.level_set(ends + np.array([0.0, 1.0])) - cut.level_set(ends)
        ends[:, 1] = -cut.level_set(ends) / rise
        opened = open_cut(*imprint(mesh.points, mesh.cells, [ends]))
        return SimplexMesh(opened.points, opened.cells)
    divided = subdivide(cut_mesh(mesh, [cut]))
    return SimplexMesh(divided.points, divided.cells)

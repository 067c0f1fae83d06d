"""The bodies of the sweep: a unit square or cube whose cut comes ever nearer to its nodes."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, identity

from verify.study.slivers.conforming_peers import PEERS, conforming_peer
from verify.study.slivers.placements import Placement, placed_cuts
from verify.xfem.corotation import InternalForce, Kinematics
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import Material, isotropic
from verify.xfem.mesh import SimplexMesh
from verify.xfem.slivers import GhostPenalty, treat_slivers
from verify.xfem.slivers.penalised_force import PenalisedForce
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = [
    "DENSITY",
    "TREATMENTS",
    "SweptBody",
    "background",
    "soft",
    "swept_body",
    "uncut_body",
]

TREATMENTS = ("keep", "drop", "merge", "ghost penalty", *PEERS)
YOUNG, POISSON, DENSITY = 1e4, 0.3, 1000.0  # the thesis' soft tissue, SI units
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
    """A body with its cuts, after the treatment of its slivers.

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
    cuts : tuple of Plane
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
    cuts: tuple[Plane, ...]

    @property
    def cut(self) -> Plane:
        """The first of the cuts."""
        return self.cuts[0]

    @property
    def is_conforming(self) -> bool:
        """Whether the mesh itself is opened: no element is cut."""
        return self.treatment in PEERS

    @cached_property
    def node_above(self) -> NDArray[np.bool_]:
        """(N,) whether the material of each unknown lies above the cut."""
        above: NDArray[np.bool_] = self.cut.level_set(self.virtual.node_piece_points) > 0.0
        return above

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """(N, d) both faces across the cut clamped; a side too, if a strip lies between cuts."""
        points = self.virtual.node_points
        ends = (points[:, -1] < 1e-9) | (points[:, -1] > 1.0 - 1e-9)
        if self.placement == "two cuts apart":
            ends |= points[:, 0] < 1e-9
        return np.repeat(ends[:, None], self.dimension, axis=1)

    def force(self, kinematics: Kinematics = "corotational") -> InternalForce:
        """Return the internal force, with the ghost penalty if there is one."""
        material = soft(self.dimension)
        if self.ghost is not None:
            return PenalisedForce(self.virtual, material, self.ghost, kinematics)
        return InternalForce(self.virtual, material, kinematics)


def swept_body(
    mesh: SimplexMesh, placement: Placement, size: float, treatment: str, hung: bool = False
) -> SweptBody:
    """Cut a mesh `size` elements from where the cut would be degenerate, and treat the slivers.

    Parameters
    ----------
    mesh : SimplexMesh
    placement, size, treatment
        As in `verify.study.slivers.measurement.Measurement`.
    hung : bool
        Whether the body is going to be held at the side where the first coordinate is zero:
        nodes there keep their unknowns.

    Raises
    ------
    ValueError
        If treatment or placement are unknown, or the conforming mesh does not exist (a cell
        without volume).
    """
    if treatment not in TREATMENTS:
        raise ValueError(f"treatment '{treatment}'; expected one of {', '.join(TREATMENTS)}")
    dim = mesh.dim
    cuts = placed_cuts(mesh, placement, size)
    cut_body = cut_mesh(mesh, cuts)
    whole = SweptBody(
        dim, placement, size, treatment, cut_body, cut_body,
        csr_array(identity(cut_body.node_count)), None, cuts,
    )  # fmt: skip
    if treatment == "ghost penalty":
        return replace(whole, ghost=GhostPenalty(cut_body, soft(dim)))
    if treatment in ("drop", "merge"):
        held = hung & (cut_body.node_points[:, 0] < 1e-9)
        treated, report = treat_slivers(cut_body, treatment, held=held)  # type: ignore[arg-type]
        return replace(whole, virtual=treated, extension=report.extension)
    if treatment == "keep":
        return whole
    opened = conforming_peer(mesh, cuts, treatment)
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

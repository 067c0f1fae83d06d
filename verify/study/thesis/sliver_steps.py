"""Slivers: the explicit step and the condition of a body whose cut comes ever nearer to nodes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from verify.methods.catalogue import cut_by
from verify.methods.cut_body import CutBody
from verify.xfem.block_pattern import block_pattern
from verify.xfem.critical_step import critical_step
from verify.xfem.cuts import Cut, Plane
from verify.xfem.elasticity import Material, isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass, consistent_mass, side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["SliverStep", "explicit_step", "exponent", "sliver_steps", "step_of_body"]

_DIVISIONS = {2: 6, 3: 2}
_METHODS = (
    "xfem", "xfem, consistent mass", "virtual_node", "subdivision", "snapping_subdivision",
    "snapping",
)  # fmt: skip
_YOUNG, _POISSON, _DENSITY = 1.0e4, 0.3, 1000.0  # Table 4.1


@dataclass(frozen=True)
class SliverStep:
    """The critical explicit step of one method with slivers of one size.

    Attributes
    ----------
    dimension : int
    method : str
    size : float
        Distance of the cut from a layer of nodes, in element sizes.
    ratio : float
        Critical step over that of the uncut body.
    smallest : float
        Smallest volume of a cell or piece over that of an uncut cell.
    """

    dimension: int
    method: str
    size: float
    ratio: float
    smallest: float


def sliver_steps(dimensions: Sequence[int], sizes: Sequence[float]) -> list[SliverStep]:
    """Cut a unit square or cube across, `sizes` above a layer of nodes."""
    found = []
    for dim in dimensions:
        n = _DIVISIONS[dim]
        mesh = rectangle_mesh((n, n)) if dim == 2 else box_mesh((n, n, n))
        up = np.eye(dim)[-1]
        uncut = explicit_step(mesh, [], "xfem")[0]
        for size in sizes:
            cut = Plane(0.5 + size * up / n, up)
            for method in _METHODS:
                step, smallest = explicit_step(mesh, [cut], method)
                found.append(SliverStep(dim, method, size, step / uncut, smallest))
    return found


def explicit_step(
    mesh: SimplexMesh, cuts: Sequence[Cut], method: str, material: Material | None = None
) -> tuple[float, float]:
    """Critical step 2/ω_max of a free cut body in s, and its smallest piece.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
    method : str
        Of `verify.methods`, ``xfem``, or ``xfem, consistent mass``; masses are otherwise lumped
        (XFEM: to each side, as in [22] of the thesis).
    material : Material, optional
        Without it that of Table 4.1; the density is Table 4.1's.
    """
    if material is None:
        material = isotropic(_YOUNG, _POISSON, "plane strain" if mesh.dim == 2 else "solid")
    if method.startswith("xfem"):
        virtual = resisting = cut_mesh(mesh, cuts)
        smallest = float((virtual.volumes / mesh.measures[virtual.parent]).min())
    else:
        body = cut_by(method, mesh, cuts)
        virtual, resisting, smallest = body.virtual, body.resisting, body.smallest_fraction
        material = body.material(material)
    mass = (consistent_mass if "consistent" in method else side_wise_mass)(virtual, _DENSITY)
    return _critical(resisting, material, mass), smallest


def step_of_body(body: CutBody) -> float:
    """Critical step 2/ω_max of a free sheet of Table 4.1 that has been cut, in s."""
    material = body.material(isotropic(_YOUNG, _POISSON, "plane stress"))
    return _critical(body.resisting, material, side_wise_mass(body.virtual, _DENSITY))


def exponent(steps: Sequence[SliverStep]) -> float:
    """Slope of log(critical step) over log(size) between the two smallest sizes."""
    two = sorted(steps, key=lambda step: step.size)[:2]
    return float(np.log(two[1].ratio / two[0].ratio) / np.log(two[1].size / two[0].size))


def _critical(resisting: VirtualMesh, material: Material, mass: Mass) -> float:
    pattern = block_pattern(resisting.cells, resisting.node_count)
    blocks = InternalForce(resisting, material, "linear").stiffness(pattern)
    return critical_step(csr_array(pattern.matrix(blocks)), mass)

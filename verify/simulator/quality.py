"""Soundness of a simulated body: volumes, closed surfaces, nothing inside out or astray.

Measured from outside, between steps: no part of what a step costs.
"""

from dataclasses import dataclass

import numpy as np

from verify.simulator.moving_surface import MovingSurface
from verify.simulator.session import Session
from verify.xfem.arrays import Floats, Ints
from verify.xfem.mesh import SimplexMesh

_ASTRAY = 2.0  # times the largest stretch in the body: no facet of the material can be that long


@dataclass(frozen=True)
class Quality:
    """State of a body.

    Attributes
    ----------
    volume_error : float
        Of the sum of all pieces, relative to the uncut body.
    enclosed_error : float
        Of the volume that the surface encloses, likewise; NaN for a membrane.
    loose_edges : int
        Edges (2D: vertices) of the surface of the material that are not used as often in one
        direction as in the other: 0 is closed. Not counted for a membrane, which encloses nothing.
    inverted_elements : int
        Pieces whose virtual element is inside out; 0 for a membrane, where that means nothing.
    largest_stretch : float
        Of the pieces.
    inverted_facets : int
        Facets of the visual surface that face the other way than the material around them.
    stray_facets : int
        Facets of the visual surface with an edge stretched more than twice as much as any piece.
    """

    volume_error: float
    enclosed_error: float
    loose_edges: int
    inverted_elements: int
    largest_stretch: float
    inverted_facets: int
    stray_facets: int


def quality_of(session: Session) -> Quality:
    """Measure the body of a session as it is now."""
    phantom, displacement = session.phantom, session.displacement
    whole = float(phantom.mesh.measures.sum())
    body = session.cutter.body  # surfaces count pieces as it does
    gradients = deformation_gradients(
        body.mesh, body.piece_parent.rows, body.piece_cells.rows, displacement
    )
    stretch = float(np.linalg.svd(gradients, compute_uv=False)[:, 0].max())
    solid = not phantom.mesh.is_membrane
    inverted = int((np.linalg.det(gradients) < 0.0).sum()) if solid else 0
    enclosed, loose = float("nan"), 0
    if solid:
        surface = session.surfaces.material.surface
        enclosed = abs(_enclosed(surface) / whole - 1.0)
        loose = _loose_edges(surface.facets.rows[surface.used])
    turned, astray = 0, 0
    if phantom.mesh.space == 3:
        turned, astray = _bad_facets(session.surfaces.shown, displacement, gradients, stretch)
    return Quality(
        abs(float(phantom.volumes.sum()) / whole - 1.0),
        enclosed, loose, inverted, stretch, turned, astray,
    )  # fmt: skip


def deformation_gradients(
    mesh: SimplexMesh, parent: Ints, nodes: Ints, displacement: Floats
) -> Floats:
    """Compute the deformation gradient (p, s, s) of each piece; of a membrane in its plane."""
    corners = mesh.points[mesh.cells[parent]] + displacement[nodes]
    return np.einsum("pki,pkj->pij", corners, mesh.gradients[parent])


def _enclosed(surface: MovingSurface) -> float:
    corners = surface.material.rows[surface.facets.rows[surface.used]]
    if corners.shape[1] == 2:
        start, end = corners[:, 0], corners[:, 1]
        return 0.5 * float(np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]))
    return float(np.linalg.det(corners).sum()) / 6.0


def _loose_edges(facets: Ints) -> int:
    size = int(facets.max(initial=-1)) + 1
    if facets.shape[1] == 2:
        return int((np.bincount(facets[:, 0], minlength=size)
                    != np.bincount(facets[:, 1], minlength=size)).sum())  # fmt: skip
    start, end = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, edge = np.unique(low * size + high, return_inverse=True)
    balance = np.bincount(edge, np.where(start < end, 1.0, -1.0))
    return int(np.count_nonzero(balance))


def _bad_facets(
    surface: MovingSurface, displacement: Floats, gradients: Floats, stretch: float
) -> tuple[int, int]:
    """Find facets that face the wrong way, and facets that are stretched beyond the material."""
    used = surface.used
    facets, piece = surface.facets.rows[used], surface.facet_piece.rows[used]
    before, after = surface.material.rows[facets], surface.positions(displacement)[facets]
    area = _area_vectors(before)
    u, _, vt = np.linalg.svd(gradients[piece])
    flip = np.linalg.det(u @ vt) < 0.0
    u[flip, :, -1] *= -1.0
    turned = np.einsum("qij,qj->qi", u @ vt, area)
    wrong = np.einsum("qi,qi->q", turned, _area_vectors(after)) < 0.0
    long, short = (np.linalg.norm(np.roll(x, 1, axis=1) - x, axis=2) for x in (after, before))
    return int(wrong.sum()), int((long > _ASTRAY * stretch * short).any(axis=1).sum())


def _area_vectors(corners: Floats) -> Floats:
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

"""Tones of a cantilever: whole, split along its length, and split to the half.

The thesis' material (E = 1e4 Pa, ν = .3, ρ = 1000 kg/m³): c_d = 3.668997 m/s.
"""

import numpy as np
import pytest
from cut_bodies import DENSITY, material
from scipy.sparse import kron
from scipy.sparse.linalg import eigsh

import verify.xfem as xfem
from verify.xfem.block_pattern import block_pattern
from verify.xfem.mass import consistent_mass


def tones(rows, cuts, mass, columns, count):
    """Lowest angular frequencies of a cantilever of length 1 and depth .2, in 1/s."""
    mesh = xfem.rectangle_mesh((columns, rows), upper=(1.0, 0.2))
    v = xfem.cut_mesh(mesh, cuts)
    pattern = block_pattern(v.cells, v.node_count)
    K = pattern.matrix(xfem.InternalForce(v, material(2), "linear").stiffness(pattern)).tocsc()
    M = kron(mass(v, DENSITY).matrix, np.eye(2)).tocsc()
    free = np.flatnonzero(np.repeat(v.node_points[:, 0] > 1e-12, 2))
    values = eigsh(
        K[free][:, free], k=count, M=M[free][:, free], sigma=0.0, return_eigenvectors=False
    )
    return np.sqrt(np.sort(values))


@pytest.mark.parametrize("mass", [xfem.side_wise_mass, consistent_mass])
@pytest.mark.parametrize(
    ("cuts", "exact", "count", "rate"),
    [
        ([xfem.Plane([0.5, 0.1], [0.0, 1.0])], 0.33435932, 2, 1.75),
        # towards 1: the tip is not enriched
        ([xfem.Polyline([[0.5, 0.1], [1.1, 0.1]])], 0.603212, 1, 1.4),
    ],
    ids=["split", "half split"],
)
def test_the_lowest_tone_of_a_cantilever_converges(mass, cuts, exact, count, rate):
    """From above (the split one: nearly h²), cut through the middle of elements."""
    # columns are even: the half cut ends on edges
    coarse, fine = (tones(rows, cuts, mass, 5 * rows + 1, count) / exact - 1.0 for rows in (9, 17))
    assert (fine > 0.0).all()
    assert (np.log(coarse / fine) / np.log(17.0 / 9.0) > rate).all()
    assert (fine < 0.03).all()
    # the two halves have the same tone up to their share of the mesh
    assert np.ptp(fine) < 0.1 * fine.max()

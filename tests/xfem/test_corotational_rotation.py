"""The rotation of a piece against a singular value decomposition, and where that is delicate."""

import numpy as np
import pytest

from verify.xfem.polar import (
    largest_eigenvector,
    nearest_rotations,
    rotation_matrices,
    rotations_in_space,
)


def _rotation(F, start=None):
    """In space by Newton's method from a quaternion."""
    if len(F) == 2 or start is None:
        return nearest_rotations(F[None])[0]
    R = np.empty((1, 3, 3))
    rotations_in_space(F[None], start[None].copy(), R)
    return R[0]


def _by_eigenvector(F, _start=None):
    q, R = np.empty((1, 4)), np.empty((1, 3, 3))
    largest_eigenvector(F, q[0])
    rotation_matrices(q, R)
    return R[0]


def _by_svd(F):
    U, _, V = np.linalg.svd(F)
    flip = np.eye(len(F))
    flip[-1, -1] = np.sign(np.linalg.det(U @ V))
    return U @ flip @ V


@pytest.mark.parametrize(
    ("dim", "rotation"), [(2, _rotation), (3, _rotation), (3, _by_eigenvector)]
)
def test_rotation_equals_that_of_the_singular_value_decomposition_also_when_inverted(dim, rotation):
    rng = np.random.default_rng(7)
    for _ in range(2000):
        F = rng.normal(size=(dim, dim))
        start = rng.normal(size=4)
        R = rotation(F, start / np.linalg.norm(start))
        s = np.linalg.svd(F)[1]
        # the rotation is as sensitive as 1/(σ₂ ± σ₃)
        gap = (s[-2] + np.sign(np.linalg.det(F)) * s[-1]) / s[0]
        assert np.abs(R - _by_svd(F)).max() * gap < 1e-13
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    "stretches",
    [
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (1.0, 1.0, 0.0),
        (-1.0, -1.0, -1.0),
        (1.0, 1.0, -1.0),
        (1.0, 1e-12, -1e-12),
        (1.0, 1.0, -1.0 + 1e-9),
        (1e-200, 1e-200, 1e-200),
        (1e120, 1e120, -1e120),
    ],
)
@pytest.mark.parametrize("rotation", [_rotation, _by_eigenvector])
def test_collapsed_and_inverted_pieces_have_a_rotation_that_attains_the_largest_trace(
    stretches, rotation
):
    rng = np.random.default_rng(1)
    for _ in range(20):
        Q = [_by_svd(rng.normal(size=(3, 3))) for _ in range(2)]
        F = Q[0] @ np.diag(stretches) @ Q[1].T
        R = rotation(F)
        s = np.sort(np.abs(stretches))
        most = s[2] + s[1] + np.copysign(s[0], np.prod(np.sign(stretches)))
        assert np.abs(R.T @ R - np.eye(3)).max() < 1e-14
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-13)
        assert np.trace(R.T @ F) == pytest.approx(most, rel=1e-13, abs=1e-14 * s[2])

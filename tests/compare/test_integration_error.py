import numpy as np
import pytest
from cut_meshes import grid, quadratic, scene, solution

from verify.compare.body import body_of
from verify.compare.body_rule import rules
from verify.compare.errors import displacement_error, energy_error, integrate_norm
from verify.compare.hooke import hooke
from verify.compare.locate import SolutionField
from verify.compare.simplices import simplices
from verify.scene import Material

LAW = hooke(Material(young=1.0, poisson=0.3, plane="strain"))


class Smooth:
    def displacement(self, points, near=None):
        x, y = points.T
        return np.column_stack([x * x * y, x * y - y**3])

    def gradient(self, points, near=None):
        x, y = points.T
        return np.array([[2 * x * y, x * x], [y, x - 3 * y * y]]).transpose(2, 0, 1)


def true_errors(field, n):
    """Errors by quadrature on the cells of the solution, as fine as need be."""
    points, cells = grid(n, n)
    for _ in range(3):  # each triangle into four
        points, six = quadratic(points, cells)
        a, b, c, ab, bc, ca = six.T
        cells = np.vstack(
            [np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    shape = simplices(points, cells)
    truth, l2, energy = Smooth(), 0.0, 0.0
    for k in range(3):  # exact for quadratic polynomials on each sub-triangle
        at = (shape.corners.sum(axis=1) + 3 * shape.corners[:, k]) / 6
        u = field.displacement(at) - truth.displacement(at)
        gradient = field.gradient(at) - truth.gradient(at)
        l2 += shape.volume @ np.sum(u**2, axis=1) / 3
        energy += 2 * shape.volume @ LAW.energy_density(gradient) / 3
    return np.sqrt(l2), np.sqrt(energy)


@pytest.mark.parametrize("n", [4, 11])
def test_the_estimated_integration_error_covers_the_true_one_and_is_small(n):
    points, cells = grid(n, n)
    field = SolutionField(solution(points, cells, Smooth().displacement(points)))
    family = rules(body_of(scene([])), 1 / n)
    true_l2, true_energy = true_errors(field, n)
    # the truth is itself integrated: fourth order on triangles of h/8, 8^-4 of the integrand
    slack = 2.5e-4
    for true, measure in (
        (true_l2, lambda r: displacement_error(field, Smooth(), r)),
        (true_energy, lambda r: energy_error(field, Smooth(), r, LAW)),
    ):
        for first, share in ((0, 0.01), (1, 0.02)):  # all rules; the two coarser, asked first
            measured = integrate_norm(measure, family[first:])
            off = abs(measured.norm.absolute - true) / measured.norm.scale
            assert off <= measured.integration_error + slack * measured.norm.relative
            assert measured.integration_error < share * measured.norm.relative

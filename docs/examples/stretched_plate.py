"""An exact solution of one's own, and the checks that it must pass.  python stretched_plate.py"""

import numpy as np

from reference.exact.solution import ExactSolution, Parameters, hooke
from verify.scene import Material


class StretchedPlate(ExactSolution):
    """σ_yy = a x, all other stresses 0: in-plane bending without a cut. ``stress_gradient`` a."""

    def __init__(self, law, parameters):
        super().__init__(law)
        self._slope = float(parameters.take("stress_gradient", ())) / law.plane_modulus

    def displacement(self, points, near=None):
        x, y = np.asarray(points, dtype=float).T
        eta = self.law.eta
        return self._slope * np.column_stack([-0.5 * (y**2 + eta * x**2), x * y])

    def gradient(self, points, near=None):
        x, y = np.asarray(points, dtype=float).T
        rows = [[-self.law.eta * x, -y], [y, x]]
        return self._slope * np.moveaxis(np.array(rows), -1, 0)


if __name__ == "__main__":
    law = hooke(Material(young=2.0, poisson=0.3, plane="strain"))
    plate = StretchedPlate(law, Parameters("stretched_plate", {"stress_gradient": 3.0}))
    points, step = np.random.default_rng(1).uniform(-1, 1, (50, 2)), 1e-6
    for j, e in enumerate(np.eye(2) * step):
        slope = (plate.displacement(points + e) - plate.displacement(points - e)) / (2 * step)
        assert np.allclose(slope, plate.gradient(points)[:, :, j], atol=1e-9)
    stress = plate.stress(points)
    assert np.allclose(stress[:, 1, 1], 3.0 * points[:, 0])
    assert np.allclose(stress[:, 0], 0.0)
    # ∫ σ²/2E' over [0, 2] × [0, 1]: a²/2E' · 8/3
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    assert np.isclose(plate.strain_energy(square), 3.0**2 / (2 * law.plane_modulus) * 8 / 3)
    print("gradient, equilibrium and energy are right")

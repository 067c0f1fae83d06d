"""The step that vertex block descent is on its way to: implicit Euler, solved by Newton's method.

The same energy, the stable neo-Hookean one, μ/2 (|F|² − 3) + λ'/2 (J − α)² with λ' = λ + μ and
α = 1 + μ/λ' (Smith, de Goes, Kim 2018), the same mesh and the same lumped mass, in 64 bits.
"""

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import splu

_TOLERANCE = 1e-10  # of the forces in play


class ImplicitEuler:
    """Body of tetrahedra: points (n, 3), positive cells (m, 4), λ, μ (m,), masses, held (n,)."""

    def __init__(self, points, cells, lame, shear, mass, held):
        edges = points[cells[:, 1:]] - points[cells[:, :1]]
        grad = np.linalg.inv(edges).transpose(0, 2, 1)
        self.grad = np.concatenate([-grad.sum(axis=1, keepdims=True), grad], axis=1)
        self.volume, self.cells = np.linalg.det(edges) / 6.0, cells
        self.shear, self.bulk = shear, lame + shear
        self.points, self.mass, self.free = points, np.repeat(mass, 3), np.repeat(~held, 3)
        dofs = (cells[:, :, None] * 3 + np.arange(3)).reshape(len(cells), 12)
        self.rows, self.columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, 12).ravel()
        self.iterations = 0

    def forces(self, u, tangent=False):
        """Return the internal forces (n, 3) and, if asked for, the tangent (3n, 3n)."""
        f = np.eye(3) + np.einsum("mai,maj->mij", u[self.cells], self.grad)
        a, b, c = f[:, :, 0], f[:, :, 1], f[:, :, 2]
        cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        j = np.einsum("mi,mi->m", a, cofactor[:, :, 0])
        pressure = self.bulk * (j - 1.0) - self.shear
        stress = self.shear[:, None, None] * f + pressure[:, None, None] * cofactor
        force = np.zeros_like(u)
        np.add.at(force, self.cells, np.einsum("m,mij,maj->mai", self.volume, stress, self.grad))
        if not tangent:
            return force, None
        moved = np.einsum("mij,maj->mai", cofactor, self.grad)  # gradient of J by the nodes
        blocks = np.einsum("m,mai,mbj->maibj", self.bulk, moved, moved)
        like = np.einsum("maj,mbj,m->mab", self.grad, self.grad, self.shear)
        blocks += np.einsum("mab,ij->maibj", like, np.eye(3))
        twist = np.einsum("mip,mpab->miab", f, _crossed(self.grad))  # Σ F (∇a × ∇b)
        blocks += np.einsum("m,miab,ijk->majbk", pressure, twist, _LEVI_CIVITA)
        blocks = (self.volume[:, None] * blocks.reshape(len(blocks), -1)).ravel()
        size = (u.size, u.size)
        return force, coo_array((blocks, (self.rows, self.columns)), shape=size).tocsc()

    def solve(self, guess, load, inertia=0.0, target=None):
        """Return the displacement with inertia M (u − target) + f(u) = load, from a guess."""
        u, free = guess.copy(), self.free
        for _ in range(60):
            force, tangent = self.forces(u, True)
            residual = load - force
            if inertia:
                residual = residual - (inertia * self.mass).reshape(-1, 3) * (u - target)
                tangent = tangent + diags_array(inertia * self.mass, format="csc")
            scale = np.abs(load).max() + np.abs(force).max()
            if np.abs(residual.ravel()[free]).max(initial=0.0) <= _TOLERANCE * scale:
                return u
            step = np.zeros(u.size)
            step[free] = splu(tangent[free][:, free]).solve(residual.ravel()[free])
            u = u + step.reshape(-1, 3)
            self.iterations += 1
        raise RuntimeError("Newton's method does not converge in 60 iterations")


_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_i, _k, _j] = 1.0, -1.0


def _crossed(grad):
    return np.cross(grad[:, :, None], grad[:, None]).transpose(0, 3, 1, 2)

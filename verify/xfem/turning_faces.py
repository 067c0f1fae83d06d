"""Contact of the faces of cuts at finite rotation: normals turn with the faces.

F is the mean of the deformation gradients on both sides of a facet, N its undeformed normal and Δ
the jump of the displacement. With C = FᵀF and d = FᵀΔ the gap along the deformed normal
n ∝ F⁻ᵀN is

    g = n·Δ = m·d,   m = y/s,   y = C⁻¹N,   s = √(N·y).

It depends on C and d alone, which no rigid motion changes. The energy is the penalty of
`verify.xfem.closing`, ∫ γ [g]₋²/2 dS over the undeformed faces, with the same γ. The mean of both
sides is weighted as the stress is there: a sliver does not turn the normal of its neighbour.

The force of a step is −p G with the pressure p at its end. G is a discrete gradient of g, with
G·δu = δg. Bars and the index m are means of both ends of the step, δ is their difference:

    δg = m̄·δd + d̄·δm,   d̄·δm = r·δy,   r = ½ (1/s₀ + 1/s₁) d̄ − (d̄·ȳ) N / (s₀ s₁ (s₀ + s₁)),
    δy = −C₁⁻¹ δC C₀⁻¹ N,   δC = Fₘᵀ δF + δFᵀ Fₘ,   δd = Fₘᵀ δΔ + δFᵀ Δₘ,

without a quotient that is 0/0. As the energy is convex in g the work of the force is at least the
change of the energy: an impact gains nothing. C and d are invariant and quadratic in positions. So
G, taken in the middle of the step, turns nothing (Simo & Tarnow, ZAMP 43, 1992; Gonzalez, Comput.
Methods Appl. Mech. Engrg. 190, 2000): momenta of a body stay, whatever the step.

At rest the pressure is −[σ + γ g]₋ as in `verify.xfem.closing`, with the nominal mean stress
σ = n·PN of the last solution: a given gap σ/γ, corrected from solution to solution. With γ = 10 of
the stability bound a correction leaves 0.16 of the error before. In n = Fm, the slip
w = F⁻¹(Δ − g n) and v = δΔ − δF w

    δg = n·v,   δn = −(1 − nn) F⁻ᵀ δFᵀ n,   δ²g = 2 δn·v − g δn·δn.
"""

from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.block_pattern import BlockPattern, pattern_places
from verify.xfem.closing import ClosingFaces
from verify.xfem.element import Material
from verify.xfem.internal_force import InternalForce, Kinematics
from verify.xfem.phantom import PhantomMesh


class _Faces(NamedTuple):
    """Faces in a configuration; letters as in the docstring of the module."""

    F: Floats  # (f, d, d)
    jump: Floats  # Δ (f, q, d)
    inverse: Floats  # C⁻¹ (f, d, d)
    y: Floats  # (f, d)
    s: Floats  # (f, 1)
    d: Floats  # (f, q, d)

    @property
    def m(self) -> Floats:
        return self.y / self.s


class TurningFaces(ClosingFaces):
    """Faces of the cuts of a body at finite rotation.

    Parameters
    ----------
    phantom : PhantomMesh
    material : Material
    moving : bool
        Whether σ is left out at rest too.

    Raises
    ------
    XfemError
        As `ClosingFaces`.
    """

    kinematics: Kinematics = "corotational"

    def __init__(self, phantom: PhantomMesh, material: Material, moving: bool = False) -> None:
        super().__init__(phantom, material, moving=True)
        self.moving = moving
        self._places: tuple[BlockPattern, Ints] | None = None

    def gaps(self, displacement: Floats) -> Floats:
        """Compute the gap g (f, q) in metres along the deformed normals; negative: overlap."""
        at = self._at(displacement)
        return np.einsum("fa,fqa->fq", at.m, at.d)

    def trial_stress(self, displacement: Floats, slide: Floats | float = 0.0) -> Floats:
        """Compute γ g (f, q) in pascal at a displacement (N, d) of the dof nodes."""
        return self.stiffness[:, None] * (self.gaps(displacement) + slide)

    def slid(self, displacement: Floats, force: InternalForce) -> Floats:
        """Compute the gap (f, q) that stands for the mean normal stress at rest: σ/γ."""
        if self.moving:
            return np.zeros(self.weights.shape)
        at, stress = self._at(displacement), force.stress(force.configuration(displacement))
        drawn = np.einsum("fs,fsab,fb->fa", self.share, stress[self.pieces], self.normal)
        drawn = np.einsum("fa,fab,fb->f", drawn, at.F, at.m) / self.stiffness
        return np.repeat(drawn[:, None], self.weights.shape[1], axis=1)

    def force(self, displacement: Floats, slide: Floats | float = 0.0) -> Floats:
        """Return the slope (N, d) of the energy, in newtons."""
        return self.force_of_step(displacement, displacement, slide)

    def force_of_step(self, before: Floats, after: Floats, slide: Floats | float = 0.0) -> Floats:
        """Return the force (N, d) of a step; with equal ends it is the slope of the energy."""
        pressures = self.weights * self.pressure(after, slide)
        forces = -np.einsum("fq,fqka->fka", pressures, self.slopes(before, after))
        count, nodes = len(before), self.nodes.ravel()
        columns = forces.reshape(-1, forces.shape[2]).T
        return np.stack([np.bincount(nodes, one, count) for one in columns], axis=1)

    def slopes(self, before: Floats, after: Floats) -> Floats:
        """Compute G (f, q, 2 (d + 1), d) by displacements (N, d) at both ends of a step."""
        first, last = self._at(before), self._at(after)
        F, jump = 0.5 * (first.F + last.F), 0.5 * (first.jump + last.jump)
        m, d, y = 0.5 * (first.m + last.m), 0.5 * (first.d + last.d), 0.5 * (first.y + last.y)
        share = 0.5 * (1.0 / first.s + 1.0 / last.s)
        fall = np.einsum("fqa,fa->fq", d, y) / (first.s * last.s * (first.s + last.s))
        r = share[..., None] * d - fall[..., None] * self.normal[:, None]
        # −r·δy, as a form in δC; then its slope by F, Fₘ times twice its symmetric part
        form = np.einsum("fab,fqb,fc->fqac", last.inverse, r, first.y)
        form += np.einsum("fab,fqb,fc->fqac", first.inverse, r, last.y)
        by_F = jump[..., None] * m[:, None, None]
        by_F -= 0.5 * F[:, None] @ (form + form.swapaxes(2, 3))
        by_jump = np.einsum("fab,fb->fa", F, m)
        slopes: Floats = by_F @ self.gradients[:, None].swapaxes(2, 3)
        return slopes.swapaxes(2, 3) + self.shapes[..., None] * by_jump[:, None, None]

    def add_stiffness_of_step(
        self, pattern: BlockPattern, blocks: Floats, before: Floats, after: Floats
    ) -> None:
        """Add γ ∇g ∇gᵀ, at the end of a step and where faces touch, to nodal blocks (B, d, d).

        It has no negative mode. It is not all of the derivative: G turns, which is as small as the
        gap, and is of the middle of the step.
        """
        del before
        self.add_tangent(pattern, blocks, after, 0.0, self.touching(after), 0.0)

    def add_tangent(
        self, pattern: BlockPattern, blocks: Floats, displacement: Floats,
        slide: Floats | float, touching: Floats | Bools, rotational: float,
    ) -> None:  # fmt: skip
        """Add the second derivative of the energy at a displacement (N, d): see the module."""
        at = self._at(displacement)
        n = np.einsum("fab,fb->fa", at.F, at.m)
        gap = np.einsum("fa,fqa->fq", n, at.jump)
        slip = np.linalg.solve(at.F[:, None], (at.jump - gap[..., None] * n[:, None])[..., None])
        steps = self.shapes - np.einsum("fqa,fia->fqi", slip[..., 0], self.gradients)
        turns = self.gradients @ np.linalg.inv(at.F)
        turns -= (turns @ n[..., None]) * n[:, None]
        pressed = rotational * self.weights * self.pressure(displacement, slide)
        share = self.weights * self.stiffness[:, None] * touching
        along = np.einsum("fq,fqi,fqj->fij", share, steps, steps)
        along += np.einsum("fq,fq,fia,fja->fij", pressed, gap, turns, turns)
        aside = np.einsum("fq,fqj,fa,fib->fijab", pressed, steps, n, turns)
        added = np.einsum("fij,fa,fb->fijab", along, n, n) + aside + aside.transpose(0, 2, 1, 4, 3)
        if self._places is None or self._places[0] is not pattern:
            rows, columns = np.broadcast_arrays(self.nodes[:, :, None], self.nodes[:, None])
            found = pattern_places(pattern, rows.ravel(), columns.ravel())
            self._places = pattern, found
        places, count = self._places[1], len(blocks)
        for k, entries in enumerate(added.reshape(len(places), blocks.shape[1] ** 2).T):
            blocks.reshape(count, -1)[:, k] += np.bincount(places, entries, count)

    def _at(self, displacement: Floats) -> _Faces:
        """Find the faces as a displacement (N, d) has them."""
        moved = displacement[self.nodes]
        F = np.eye(moved.shape[2]) + np.einsum("fka,fkb->fab", moved, self.gradients)
        jump = self.shapes @ moved
        inverse = np.linalg.inv(F.swapaxes(1, 2) @ F)
        y = np.einsum("fab,fb->fa", inverse, self.normal)
        s = np.sqrt(np.einsum("fa,fa->f", self.normal, y))[:, None]
        return _Faces(F, jump, inverse, y, s, jump @ F)

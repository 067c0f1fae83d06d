"""Change of the displacement of a body with a straight crack when an end of it advances.

The displacement of the outline is held. du/da of an end is then Bueckner's weight function: it
vanishes on the outline, leaves the faces free of traction and grows like r^-1/2 at that end.
In the complex potentials of Griffith's crack, R = √(z−a) √(z+a),

    φ = R (c/(z − e) + P) + Q,    ω = R (c/(z − e) + P) − Q,

where e is the end and c follows from dR/de. The polynomials P and Q undo the values of the first
term on the outline, by least squares. Nothing of it is finite elements.
"""

import numpy as np
from numpy.polynomial import polynomial

from reference.exact.straight_cracks import ComplexCrack, Potentials

_ORDER, _POINTS = 24, 120  # terms of each polynomial; collocation points on a side


def tip_advances(crack, outline):
    """Derivatives of the displacement by the places of both ends, apart by modes.

    Parameters
    ----------
    crack : Griffith
    outline : (n, 2) array
        Corners of the body, in order, m.

    Returns
    -------
    list of TipAdvance
        End at +a of the crack's axis, mode I and II; end at −a, mode I and II. Each end advances
        outwards, and the derivative by its place is the sum of its modes.
    """
    around = _along(outline)
    size = 1.5 * np.abs(outline - crack._origin).max()
    fields = [TipAdvance(crack, end, mode, size) for end in (1, -1) for mode in (0, 1)]
    regular = TipAdvance(crack, 1, 0, size)
    regular.strength = 0.0
    columns = []
    for row in range(2):
        for k in range(_ORDER):
            for unit in (1.0, 1j):
                regular.terms[row, k] = unit
                columns.append(regular.displacement(around).ravel())
                regular.terms[row, k] = 0.0
    undone = np.stack([-field.displacement(around).ravel() for field in fields], axis=1)
    found = np.linalg.lstsq(np.array(columns).T, undone, rcond=1e-12)[0]
    for field, x in zip(fields, found.T, strict=True):
        field.terms = x.reshape(2, _ORDER, 2) @ [1.0, 1j]
    return fields


class TipAdvance(ComplexCrack):
    """The singular term of one end and mode, and the polynomials `terms` (2, k) P and Q."""

    def __init__(self, crack, end, mode, size):
        super().__init__(crack.law, crack._origin, 0.0)
        self._axes, self._a, self._end, self._size = crack._axes, crack._a, end * crack._a, size
        share = crack._s.real if mode == 0 else 1j * crack._s.imag
        self.strength = -0.25 * end * share  # ½ S dR/de, with dR/de = ∓ R / (2 (z ∓ a)) outwards
        self.terms = np.zeros((2, _ORDER), complex)

    @property
    def _last(self):
        """Nothing of a last evaluation is kept: strength and terms are set after it."""

    @_last.setter
    def _last(self, _kept):
        pass

    def _on_crack(self, x):
        return np.abs(x) < self._a

    def _potentials(self, z, sheet):
        left, right = z.copy(), z.copy()  # by parts, which keeps a negative zero
        left.real -= self._a
        right.real += self._a
        root = sheet * np.sqrt(left) * np.sqrt(right)
        slope, bend = z / root, -(self._a**2) / root**3
        bar, slope_bar = root.conj(), z.conj() / root.conj()
        (p, p1, p2), (q, q1, q2) = self._odd(z), self._values(1, z)
        (p_bar, p1_bar, _), (q_bar, q1_bar, _) = self._odd(z.conj()), self._values(1, z.conj())
        return Potentials(
            root * p + q,
            slope * p + root * p1 + q1,
            bend * p + 2 * slope * p1 + root * p2 + q2,
            bar * p_bar - q_bar,
            slope_bar * p_bar + bar * p1_bar - q1_bar,
        )

    def _odd(self, z):
        """What R is multiplied by, and its two derivatives."""
        off, c = z - self._end, self.strength
        pole = (c / off, -c / off**2, 2 * c / off**3)
        return [a + b for a, b in zip(self._values(0, z), pole, strict=True)]

    def _values(self, row, z):
        scaled = self.terms[row] / self._size ** np.arange(_ORDER)
        return [polynomial.polyval(z, polynomial.polyder(scaled, m)) for m in range(3)]


def _along(outline):
    """Points on the outline, denser towards its corners."""
    share = 0.5 - 0.5 * np.cos((np.arange(_POINTS) + 0.5) * np.pi / _POINTS)
    sides = zip(outline, np.roll(outline, -1, axis=0), strict=True)
    return np.concatenate([p + share[:, None] * (q - p) for p, q in sides])

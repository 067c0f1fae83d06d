"""A half-infinite crack whose faces bear a uniform traction from the time 0 on.

Laplace transforms in time (s) and along the crack (sζ) leave one equation of Wiener–Hopf for the
stress ahead and the displacement behind, Σ₊ + Σ₋ ∝ F₊F₋ U₋, with the slownesses a and b of
pressure and shear waves. A traction σ from the time 0 on gives K = 2σ√(2t/π)/F₊(0), where the
function of Rayleigh, b⁴ at ζ = 0, and √a, √b of the displacement's own wave make

    F₊(0)² = b⁴/(2a(b² − a²)) in mode I, b⁴/(2b(b² − a²)) in mode II, b in mode III.

L. B. Freund, Dynamic Fracture Mechanics (1990), sections 2.3 to 2.5. It holds at a tip until a wave
has come back to it. In plane stress it holds with the Lamé constant of the plane law.
"""

from typing import Literal

import numpy as np

from reference.exact.hooke import Hooke
from verify.errors import InputError


def sudden_intensity(
    mode: Literal["I", "II", "III"], traction: float, law: Hooke, time: float
) -> float:
    """Stress-intensity factor, Pa √m.

    Parameters
    ----------
    mode : {"I", "II", "III"}
        Of the traction: pressure, shear across the front, shear along it.
    traction : float
        Pa.
    law : Hooke
    time : float
        s.

    Raises
    ------
    InputError
        If the law has no density.
    """
    shear_wave = _shear_wave(law)
    k = law.shear / (law.lame + 2 * law.shear)  # (c_s/c_d)²
    squared = {
        "I": 2 * np.sqrt(k) * (1 - k),  # c_s t times this: with c_d = c_s/√k
        "II": 2 * (1 - k),
        "III": 1.0,
    }[mode]
    return float(2 * traction * np.sqrt(2 * squared * shear_wave * time / np.pi))


def sudden_slip(traction: float, law: Hooke, distance: float, time: float) -> float:
    """Displacement jump along the front at a distance behind it, m: antiplane.

    The velocity of a face is (τc/μ) [1 − (2/π) arctan √(ct/r − 1)], c that of shear waves: the
    pole ζ = 0 is the plane wave, the branch cut from b on what comes from the tip.

    Parameters
    ----------
    traction : float
        Shear along the front on each face, Pa.
    law : Hooke
    distance : float
        r, m.
    time : float
        s.

    Raises
    ------
    InputError
        If the law has no density.
    """
    way = _shear_wave(law) * time
    if way <= distance:
        return 2 * traction / law.shear * way
    reach = np.sqrt(distance * (way - distance))
    slip = way * np.arcsin(np.sqrt(distance / way)) + reach
    return float(4 * traction / (np.pi * law.shear) * slip)


def _shear_wave(law: Hooke) -> float:
    if law.density is None:
        raise InputError("a crack in motion needs the density of the material")
    return float(np.sqrt(law.shear / law.density))

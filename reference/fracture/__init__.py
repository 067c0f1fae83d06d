"""Fracture parameters of plane fields given as arrays: J, K_I, K_II and crack opening.

They are computed from a `verify.solution.Solution` alone, so from any solver's.
"""

from reference.fracture.domain import JIntegral, j_integral
from reference.fracture.intensity import StressIntensity, stress_intensity
from reference.fracture.opening import crack_opening
from reference.fracture.tips import Tip, tips

__all__ = [
    "JIntegral",
    "StressIntensity",
    "Tip",
    "crack_opening",
    "j_integral",
    "stress_intensity",
    "tips",
]

"""Fracture parameters of fields given as arrays: J, K_I, K_II, K_III and crack opening.

They are computed from a `verify.solution.Solution` alone, so from any solver's.
"""

from reference.fracture.domain import JIntegral, j_integral
from reference.fracture.face_opening import FaceOpening, face_opening
from reference.fracture.front import CircularFront, Front, FrontCoordinates, StraightFront
from reference.fracture.front_intensity import FrontIntensity, front_intensity
from reference.fracture.intensity import StressIntensity, stress_intensity
from reference.fracture.opening import crack_opening
from reference.fracture.tips import Tip, no_tip, tips

__all__ = [
    "CircularFront",
    "FaceOpening",
    "Front",
    "FrontCoordinates",
    "FrontIntensity",
    "JIntegral",
    "StraightFront",
    "StressIntensity",
    "Tip",
    "crack_opening",
    "face_opening",
    "front_intensity",
    "j_integral",
    "no_tip",
    "stress_intensity",
    "tips",
]

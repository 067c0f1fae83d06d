"""Fracture parameters of fields given as arrays: K_I, K_II, K_III.

They are computed from a `verify.solution.Solution` alone, so from any solver's.
"""

from reference.fracture.cells import stress_of
from reference.fracture.intensity import (
    DomainError,
    FrontIntensity,
    StressIntensity,
    front_intensity,
    stress_intensity,
)
from reference.fracture.tips import (
    CircularFront,
    Front,
    FrontCoordinates,
    StraightFront,
    Tip,
    front_at,
    front_reach,
    no_tip,
    station_count,
    station_spacing,
    tip_at,
    tips,
)

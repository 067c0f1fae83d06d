"""Motion of cut bodies: time integration, supports, loads, and the inheritance of a state."""

from verify.xfem.dynamics.body import DynamicBody, MotionState, MovingSupports, RayleighDamping
from verify.xfem.dynamics.explicit import (
    CentralDifferences,
    ForwardEuler,
    SymplecticEuler,
    acceleration_of,
)
from verify.xfem.dynamics.generalised_alpha import GeneralisedAlpha
from verify.xfem.dynamics.implicit import EnergyMomentum, ImplicitEuler, Trapezoidal
from verify.xfem.dynamics.inheritance import ancestors, inherit_state
from verify.xfem.dynamics.integrator import Integrator, StepFailedError, StepForces
from verify.xfem.dynamics.real_time import RealTimeEuler
from verify.xfem.dynamics.sliver_treatment import TreatedBody, treat_moving_body
from verify.xfem.dynamics.step_control import MeasuredPace, StepPerUnknown

__all__ = [
    "CentralDifferences",
    "DynamicBody",
    "EnergyMomentum",
    "ForwardEuler",
    "GeneralisedAlpha",
    "ImplicitEuler",
    "Integrator",
    "MeasuredPace",
    "MotionState",
    "MovingSupports",
    "RayleighDamping",
    "RealTimeEuler",
    "StepFailedError",
    "StepForces",
    "StepPerUnknown",
    "SymplecticEuler",
    "Trapezoidal",
    "TreatedBody",
    "acceleration_of",
    "ancestors",
    "inherit_state",
    "treat_moving_body",
]

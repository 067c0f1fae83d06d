"""Whether energy and momenta are kept: drifts, jumps at cuts, inertia of freed pieces."""

from verify.study.energy.drift import Drift, secular_drift
from verify.study.energy.study import EnergyStudy, energy_study

__all__ = ["Drift", "EnergyStudy", "energy_study", "secular_drift"]

"""How far the error bars of the reference can be trusted, on cases whose truth is known."""

from verify.study.calibration.study import CalibrationStudy, calibration_study

__all__ = ["CalibrationStudy", "calibration_study"]

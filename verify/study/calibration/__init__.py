"""Coverage of the reference's error bars, on cases whose truth is known."""

from verify.study.calibration.study import CalibrationStudy, calibration_study

__all__ = ["CalibrationStudy", "calibration_study"]

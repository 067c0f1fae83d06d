"""The thesis' tables and figures measured again, and its claims judged."""

from verify.study.thesis.study import CASES, SOLVERS, ThesisStudy, thesis_study

__all__ = ["CASES", "SOLVERS", "ThesisStudy", "thesis_study"]

"""Rankings of the solvers of a run by accuracy, robustness, energy and cost."""

from verify.study.ranking.ranking import rank_solvers

__all__ = ["rank_solvers"]

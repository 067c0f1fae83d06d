"""Cost of accuracy, once and over a cut that grows."""

from verify.study.cost.study import CostStudy, cost_study, growing_scenes

__all__ = ["CostStudy", "cost_study", "growing_scenes"]

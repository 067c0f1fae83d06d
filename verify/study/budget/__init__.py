"""Where the error of an XFEM answer comes from, and the cheapest model that is good enough."""

from verify.study.budget.budget import Budget, Part, error_budget
from verify.study.budget.cheapest import Candidate, cheapest_adequate
from verify.study.budget.scenes import on_realised_cut, with_kinematics
from verify.study.budget.study import BudgetStudy, Solved, budget_study, is_realised_as_asked

__all__ = [
    "Budget",
    "BudgetStudy",
    "Candidate",
    "Part",
    "Solved",
    "budget_study",
    "cheapest_adequate",
    "error_budget",
    "is_realised_as_asked",
    "on_realised_cut",
    "with_kinematics",
]

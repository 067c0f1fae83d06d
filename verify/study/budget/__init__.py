"""Parts of the error of an XFEM answer, and the cheapest model that is good enough."""

from verify.assess.changed_scenes import on_realised_cut, with_kinematics
from verify.study.budget.budget import Answer, Budget, Part, error_budget
from verify.study.budget.cheapest import Candidate, cheapest_adequate
from verify.study.budget.cut_ends import CutEnd, cut_ends
from verify.study.budget.links import Missing, is_realised_as_asked
from verify.study.budget.solved import Solve, Solved
from verify.study.budget.study import BudgetStudy, budget_study

__all__ = [
    "Answer",
    "Budget",
    "BudgetStudy",
    "Candidate",
    "CutEnd",
    "Missing",
    "Part",
    "Solve",
    "Solved",
    "budget_study",
    "cheapest_adequate",
    "cut_ends",
    "error_budget",
    "is_realised_as_asked",
    "on_realised_cut",
    "with_kinematics",
]

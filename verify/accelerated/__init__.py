"""Operations of `verify.xfem` at the speed of the machine, equal to the plain ones to round-off."""

from verify.accelerated.cholesky import NearlySymmetric
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.one_pass import OnePassTetrahedra
from verify.accelerated.solver_by_cost import DirectBySize, SolverByCost
from verify.accelerated.two_level import TwoLevel
from verify.xfem.linear_solvers import Kernels

FAST = Kernels(
    DirectBySize, ConjugateGradients, SolverByCost, NearlySymmetric, OnePassTetrahedra, TwoLevel
)

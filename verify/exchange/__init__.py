"""Exchange with solvers that are not part of the project: arrays, files, programs.

`problem_of` turns a scene into arrays for a solver in Python, `export_case` writes them as files,
`ProgramSolver` runs any program on those files, and `read_answers` reads what it answered.
`export_fields` writes the solutions of a run for ParaView.
"""

from verify.exchange.export import Answers, ProgramSolver, answers_of, export_case, read_answers
from verify.exchange.paraview import export_fields
from verify.exchange.problem import HeldNodes, Load, Problem, problem_of

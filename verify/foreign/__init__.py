"""Solvers of others, each in a virtual environment of its own, spoken to through files.

`records` reads what `programs/` says of each, `installing` makes and removes the environments,
and `ForeignProgram` makes one a solver. The programs themselves are stand-alone: they are run by
their own Python and import nothing of this package.
"""

from verify.foreign.installing import (
    ForeignProgram,
    ForeignSolver,
    foreign_solver,
    foreign_solvers,
    install,
    remove,
    state_of,
)

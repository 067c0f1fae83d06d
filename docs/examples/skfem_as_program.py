"""The program of skfem_program.py as a solver: exported, run and read back for every solve."""

import sys

from verify.exchange import ProgramSolver


class SkfemProgram(ProgramSolver):
    name = "skfem-program"
    command = (sys.executable, "skfem_program.py", "{folder}", "{level}")
    conforming = True

    def refuses(self, scene):
        still = scene.analysis.kind == "static" and scene.analysis.kinematics == "linear"
        return None if still and scene.dimension == 2 else "only linear statics in the plane"

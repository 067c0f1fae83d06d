"""The scene: a requirement and the solver-neutral physics that decides it."""

from pydantic import model_validator

from verify.scene.rules import first_fault_of_parts
from verify.scene.tables import SceneTables


class Scene(SceneTables):
    """One case. Solver-neutral: it says what is asked, never how a solver shall do it."""

    @model_validator(mode="after")
    def _is_consistent(self) -> "Scene":
        if fault := first_fault_of_parts(self):
            raise ValueError(fault)
        return self

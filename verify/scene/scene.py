"""The scene: a requirement and the solver-neutral physics that decides it."""

from pathlib import Path

from pydantic import PrivateAttr, model_validator

from verify.scene.family import Row
from verify.scene.placement import check_placement
from verify.scene.replay_placement import check_replay
from verify.scene.tables import SceneTables


class Scene(SceneTables):
    """One case. Solver-neutral: it says what is asked, never how a solver shall do it."""

    # where it was read from; set by `load_scene`
    _file: Path | None = PrivateAttr(default=None)
    _name: str = PrivateAttr(default="scene")
    _row: Row | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _is_consistent(self) -> "Scene":
        check_placement(self)
        check_replay(self)
        return self

    @property
    def name(self) -> str:
        """Name of the case: its path below the case folder, e.g. ``statics/f1_patch``.

        Of a row of a family with the value: ``slivers/plane[epsilon=0.01]``.
        """
        return self._name

    @property
    def row(self) -> Row | None:
        """Which row of its family it is; None for a case without parameters."""
        return self._row

    @property
    def file(self) -> Path | None:
        """The case file, if it came from one."""
        return self._file

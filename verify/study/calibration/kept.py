"""Trials of a run that was broken off, for the one that goes on: a file beside the record."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.provenance import provenance
from verify.study.calibration.trial import Trial

FILE = "calibration.trials.json"


class KeptTrials:
    """Trials by family and scene, written whenever a scene is done.

    Those of before are reused if they are of the same commit, without changes of its files, of the
    same versions and seed.

    Parameters
    ----------
    directory : Path or None
        None keeps nothing.
    seed : int
    """

    def __init__(self, directory: Path | None, seed: int) -> None:
        self.path = None if directory is None else directory / FILE
        about = provenance()
        self.made_by = {"seed": seed, **{name: about[name] for name in ("commit", "versions")}}
        self.scenes: dict[str, list[dict[str, Any]]] = {}
        if self.path is not None and self.path.exists() and about["dirty"] is False:
            self.scenes = self._read(self.path)

    def of(self, family: str, index: int, make: Callable[[], list[Trial]]) -> list[Trial]:
        """Return the trials of a scene, made now if they are not kept."""
        name = f"{family} {index}"
        if name not in self.scenes:
            self.scenes[name] = [asdict(one) for one in make()]
            if self.path is not None:
                write_json({"made_by": self.made_by, "scenes": self.scenes}, self.path)
        return [Trial(**one) for one in self.scenes[name]]

    def _read(self, path: Path) -> dict[str, list[dict[str, Any]]]:
        try:
            kept = read_json(path)
        except InputError:
            return {}
        scenes = kept.get("scenes")
        return scenes if kept.get("made_by") == self.made_by and isinstance(scenes, dict) else {}

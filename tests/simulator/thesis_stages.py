"""The scenes of the thesis as stages."""

from dataclasses import replace
from pathlib import Path

from verify.scene import load_scene
from verify.simulator import Stage, stage_of

CASES = Path(__file__).resolve().parents[2] / "cases" / "thesis"


def stage(name: str, **changes) -> Stage:
    return replace(stage_of(load_scene(CASES / f"{name}.toml")), **changes)

"""Cutting scenes played as a simulator would: tool, incision, pulls, surfaces, step by step."""

from verify.replay.quality import Quality, quality_of
from verify.replay.session import Session
from verify.replay.stage import Hold, Hook, Stage
from verify.replay.stage_of_scene import stage_of
from verify.replay.step_record import PHASES, StepRecord

__all__ = [
    "PHASES", "Hold", "Hook", "Quality", "Session", "Stage", "StepRecord", "quality_of", "stage_of",
]  # fmt: skip

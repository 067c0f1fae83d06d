"""Cutting scenes played as a simulator would: tool, incision, pulls, surfaces, step by step."""

from verify.simulator.quality import Quality, quality_of
from verify.simulator.session import PHASES, Session, StepRecord
from verify.simulator.stage import Hold, Hook, Stage, stage_of

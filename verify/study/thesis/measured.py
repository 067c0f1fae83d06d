"""All that the study of the thesis measures, before it is judged."""

from dataclasses import dataclass

from verify.simulator.thesis.added_nodes import FaceCount, StripCount
from verify.simulator.thesis.delays import Delay, Frames
from verify.simulator.thesis.real_time import RealTime, StepTime
from verify.study.thesis.methods_compared import MethodOnCase
from verify.study.thesis.sliver_systems import SliverSystem


@dataclass(frozen=True)
class Measured:
    """Numbers of all tables.

    Attributes
    ----------
    strips, face : Table 4.3, Figure 4.11
    steps : Tables 4.4 and 4.5, Figure 4.25
    delays, frames : Table 4.6, Figure 4.26
    hand : real time
    methods : accuracy
    slivers : stability, and what goes wrong
    contended : str
        Why times may be too long, if they may.
    """

    strips: list[StripCount]
    face: list[FaceCount]
    steps: list[StepTime]
    delays: list[Delay]
    frames: list[Frames]
    hand: RealTime
    methods: list[MethodOnCase]
    slivers: list[SliverSystem]
    contended: str = ""

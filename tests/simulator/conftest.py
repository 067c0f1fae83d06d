"""Stages that the tests share."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from thesis_stages import stage

from verify.simulator import Hold, Stage
from verify.simulator.skin_mesh import procedural_face
from verify.xfem.mesh import SimplexMesh

sys.path.append(str(Path(__file__).resolve().parents[1] / "xfem"))


@pytest.fixture(scope="session")
def hand() -> Stage:
    return stage("hand_straight")


@pytest.fixture(scope="session")
def block() -> Stage:
    return stage("block_cut_once")


@pytest.fixture(scope="session")
def coarse_face() -> Stage:
    """The face with 1200 triangles in place of 7500: what costs time here is the solve."""
    points, triangles, rim = procedural_face().triangulate(1200)
    whole = stage("face_incision", hooks=[], strokes=[])
    held = Hold(np.arange(len(points)) < rim, (0, 1, 2), np.zeros(3))
    return replace(whole, mesh=SimplexMesh(points, triangles), holds=[held])

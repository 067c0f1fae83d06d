"""The face and the hand of the MakeHuman mesh under the knife, where they have been fetched."""

from dataclasses import replace

import numpy as np
import pytest
from thesis_stages import CASES

from verify.scene import load_scene
from verify.simulator import Session, quality_of, stage_of
from verify.simulator.anatomy.store import patch_file
from verify.xfem.cuts import ToolPath

ROUND_OFF = 1e-12


@pytest.fixture(params=["hand", "face"])
def anatomy(request, tmp_path):
    """A case of the thesis with the real surface; stroke and hooks placed by its own extent."""
    if not patch_file(request.param).is_file():
        pytest.skip("the anatomy is not here: 'verify data anatomy' fetches it")
    case = {"hand": "hand_straight", "face": "face_incision"}[request.param]
    text = (CASES / f"{case}.toml").read_text(encoding="utf-8")
    path = tmp_path / f"{request.param}.toml"
    path.write_text(text.replace('kind = "skin"', 'kind = "skin"\nsource = "anatomy"'))
    stage = stage_of(load_scene(path))
    points = stage.mesh.points
    middle, size = points.mean(axis=0), np.ptp(points, axis=0)
    if request.param == "face":
        middle[0] += 0.2 * size[0]  # the cheek
    reach = 0.15 * size[1]
    tips = middle + reach * np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    tips[:, 2] = points[:, 2].max() + 0.01
    stroke = ToolPath.of_tip(tips, [0.05, 0.5], [0.0, 0.0, -size[2] - 0.02])
    near = np.linalg.norm((points - middle)[:, :2], axis=1).argmin()
    pull = 0.004 if request.param == "face" else 0.008
    hooks = [
        replace(
            hook, at=points[near], side=side, radius=0.006, begin=0.6, duration=0.5,
            vector=np.array([-side * pull, 0.0, 0.002]),
        )
        for hook, side in zip(stage.hooks, (1, -1), strict=True)
    ]  # fmt: skip
    return replace(stage, strokes=[stroke], hooks=hooks, duration=1.4)


def test_a_real_surface_is_cut_and_pulled_open_as_soundly_as_a_smooth_one(anatomy) -> None:
    session = Session(anatomy)
    while not session.finished:
        record = session.step()
        if record.newly_split or record.step % 10 == 0:
            found = quality_of(session)
            assert found.volume_error < ROUND_OFF
            if not anatomy.is_membrane:
                assert found.enclosed_error < ROUND_OFF
                assert found.loose_edges == 0
                assert found.inverted_elements == 0
    assert session.records[-1].split > 10
    work = max(record.work for record in session.records)
    assert work > 0.0
    for record in session.records:
        assert abs(record.mechanical - record.work + record.dissipated) < 1e-9 * work
        assert record.mechanical <= record.work + 1e-9 * work

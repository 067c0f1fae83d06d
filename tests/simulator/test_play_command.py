"""``verify play`` draws without a display, says what a step took, and refuses in one line."""

import csv
import json

import numpy as np
import pytest
from PIL import Image
from thesis_stages import CASES

from verify.cli import main
from verify.scene import load_scene
from verify.simulator import Session, stage_of
from verify.simulator.animation import LiveScalpel, stroke_text, write_strokes

graphics = pytest.mark.graphics


@graphics
def test_an_animation_is_drawn_without_a_display(tmp_path, monkeypatch, capfd) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    out, table = tmp_path / "square.gif", tmp_path / "steps.csv"
    command = ["play", str(CASES / "square_dissected.toml"), "--out", str(out), "--frames", "6",
               "--records", str(table), "--json"]  # fmt: skip
    assert main(command) == 0
    said = capfd.readouterr()
    assert "WARN" not in said.err  # VTK's own, of the X server that is not there
    summary = json.loads(said.out)
    assert summary["loose_edges"] == summary["inverted_elements"] == 0
    with Image.open(out) as animation:
        assert animation.n_frames >= 6
        pictures = []
        for k in (0, animation.n_frames - 1):
            animation.seek(k)
            pictures.append(np.asarray(animation.convert("RGB"), dtype=int))
    drawn = [(p.sum(axis=2) < 3 * 250).mean() for p in pictures]
    assert min(drawn) > 0.01  # there is a body in each
    assert np.abs(pictures[0] - pictures[1]).max() > 50  # and it has moved
    rows = list(csv.DictReader(table.open(encoding="utf-8")))
    assert len(rows) == summary["steps"]
    assert int(rows[-1]["split"]) == summary["split"] > 50
    across = summary["cuts"][0]
    assert across["name"] == "across"
    assert float(rows[-1]["cut_work_across"]) == across["cut_work"] > 0.0
    # forces times advances, at 2 m/s in steps of 5 ms, sum up to the work but for ends
    forces = [float(row["driving_force_across"] or 0.0) for row in rows]
    assert max(forces) == across["largest_driving_force"]
    assert 0.01 * sum(forces) == pytest.approx(across["cut_work"], rel=0.3)
    assert {row["resistance_across"] for row in rows} == {""}  # it has no toughness


def test_a_live_scalpel_cuts_what_it_is_led_through_and_its_stroke_can_be_played_again(
    tmp_path,
) -> None:
    """The hand moves 5 mm a step across the block; the file gives the same pieces again."""
    path = CASES / "block_cut_once.toml"
    text = path.read_text(encoding="utf-8")
    stage = stage_of(load_scene(path))
    session = Session(type(stage)(**{**vars(stage), "strokes": [], "hooks": [], "visual": None}))
    scalpel = LiveScalpel(session, 0.06)
    for y in np.arange(-0.02, 0.125, 0.01):
        scalpel.touch(np.array([0.052, y, 0.1]), np.array([0.01, 0.0, -1.0]))
        session.step()
    scalpel.lift()
    session.step()
    cut = session.cutter.body.split_cells
    assert cut.sum() > 50
    assert len(scalpel.finished) == 1
    write_strokes(scalpel.finished, tmp_path / "stroke.toml")
    stroke = (tmp_path / "stroke.toml").read_text(encoding="utf-8")
    assert stroke == stroke_text(scalpel.finished[0], "stroke_1")
    begin, end = text.index("[[cuts]]"), text.index("[analysis]")
    again = tmp_path / "again.toml"
    pulls = text[end:].replace('cut = "first"', 'cut = "stroke_1"')
    again.write_text(text[:begin] + stroke + "\n" + pulls, encoding="utf-8")
    replayed = Session(stage_of(load_scene(again)))
    while replayed.time < session.time:
        replayed.step()
    np.testing.assert_array_equal(replayed.cutter.body.split_cells, cut)

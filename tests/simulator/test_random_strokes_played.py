"""Strokes at random across face, hand and block, played under implicit steps, hooks pulling."""

import pytest
from stroke_campaign import play_random_strokes

QUICK, ALL, CHUNKS = 1, 334, 12


@pytest.mark.parametrize("body", ["coarse_face", "hand", "block"])
def test_random_strokes_keep_volume_surface_and_energy(body, request) -> None:
    stage = request.getfixturevalue(body)
    split = [play_random_strokes(stage, seed).records[-1].split for seed in range(QUICK)]
    assert max(split) > 5  # they did cut


@pytest.mark.heavy
@pytest.mark.parametrize("chunk", range(CHUNKS))
@pytest.mark.parametrize("body", ["coarse_face", "hand", "block"])
def test_a_thousand_random_strokes_keep_volume_surface_and_energy(body, chunk, request) -> None:
    """In chunks: each seed is a scene of its own, so they can be played in any order and apart."""
    stage = request.getfixturevalue(body)
    for seed in range(chunk, ALL, CHUNKS):
        play_random_strokes(stage, seed)

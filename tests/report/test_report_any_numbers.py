"""Whatever numbers a solver has left in the records, the run ends with a report."""

import json
import random

import pytest
from synthetic_run import make_run

from verify.report import render

ABSURD = (
    0.0, -0.0, 1.0, -1.0, 1e300, -1e300, 1.7976931348623157e308, 5e-324, 1e-300, 1e17, 10**30, -5,
    None,
)  # fmt: skip
LOST = ("nan", "inf", "-inf")


def spoilt(value, chance, rng, place, lost):
    """Numbers of a result replaced by others, some of them by what JSON has no word for."""
    if isinstance(value, dict):
        return {
            k: v if k == "level" else spoilt(v, chance, rng, f"{place}/{_key(k)}", lost)
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [spoilt(v, chance, rng, f"{place}/{i}", lost) for i, v in enumerate(value)]
    if isinstance(value, bool) or not isinstance(value, int | float) or rng.random() > chance:
        return value
    if isinstance(value, float) and rng.random() < 0.3:
        lost[place] = rng.choice(LOST)
        return None
    return rng.choice([n for n in ABSURD if isinstance(value, float) or isinstance(n, int)])


def _key(key):
    return key.replace("~", "~0").replace("/", "~1")


def spoil(root, seed):
    rng = random.Random(seed)
    chance = rng.choice((0.02, 0.2, 1.0))
    for file in sorted(root.glob("cases/*/result.json")):
        content, lost = json.loads(file.read_text()), {}
        kept = {key: content[key] for key in ("schema", "scene")}
        content = spoilt(content, chance, rng, "", lost) | kept
        lost = {place: word for place, word in lost.items() if not place.startswith("/scene/")}
        file.write_text(json.dumps({**content, "not_finite": lost}))


def assert_whole(text):
    assert "</html>" in text
    assert "cannot be shown" not in text
    assert "pictures of this case failed" not in text


@pytest.mark.parametrize("seed", range(6))
def test_numbers_of_any_size_are_reported(tmp_path, seed):
    root = make_run(tmp_path / "run", pictures=False)
    spoil(root, seed)
    assert_whole(render(root).read_text())

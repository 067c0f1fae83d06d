"""Rules by which a blade opens a cut, on the exact strip: docs/theory/dynamics.md has the tables.

``pytest -m heavy -s tests/study/test_opening_rules.py`` prints them.
"""

import numpy as np
import pytest
from strip_rules import RULES, Strip, solve

ELEMENTS = (8, 16, 32, 64)


def orders(outcomes):
    return -np.diff(np.log2([one.displacement for one in outcomes]))


@pytest.mark.heavy
@pytest.mark.parametrize("lumped", [True, False], ids=["lumped", "consistent"])
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.6, 0.8])
def test_forces_that_fade_have_no_lag_and_take_what_else_stays_as_waves(speed, lumped):
    elements = ELEMENTS if lumped else ELEMENTS[:3]
    strips = [Strip(n, speed) for n in elements]
    found = {rule: [solve(strip, rule, lumped) for strip in strips] for rule in RULES}
    for rule, outcomes in found.items():
        columns = [
            " ".join(f"{getattr(one, name):.4f}" for one in outcomes)
            for name in ("displacement", "velocity", "kinetic", "taken")
        ]
        exact = outcomes[-1].exact_kinetic
        print(f"{speed} {'lumped' if lumped else 'consistent'} | {rule} | ", end="")
        print(" | ".join(columns), f"| exact kinetic {exact:.4f}")
    swept, centroid, late = (found[rule] for rule in ("swept", "centroid", "late"))
    for one, other in zip(swept, centroid, strict=True):
        assert one.displacement < other.displacement
    assert orders(swept).mean() > 1.0
    # a release at once leaves all of G in the mesh, whatever h
    assert late[-1].kinetic > 1.5 * late[-1].exact_kinetic
    assert abs(late[-1].taken) < 1e-12
    if speed <= 0.6:
        assert swept[-1].taken == pytest.approx(1.0, abs=0.08)
        assert swept[-1].velocity < 0.4 * centroid[-1].velocity
    assert swept[-1].kinetic < late[-1].kinetic


def test_the_swept_share_is_better_than_late_on_two_coarse_meshes():
    """What the heavy study shows, at 0.3 c."""
    late, swept = (
        [solve(Strip(n, 0.3), rule, True) for n in (8, 16)] for rule in ("late", "swept")
    )
    assert orders(swept)[0] > 1.0
    for one, other in zip(swept, late, strict=True):
        assert one.displacement < 0.4 * other.displacement
    assert swept[-1].taken == pytest.approx(1.0, abs=0.08)

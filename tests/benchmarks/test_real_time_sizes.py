"""Largest body that is played at 60 Hz, at rest and while it is cut.

    pytest tests/benchmarks/test_real_time_sizes.py -m timing -s

prints the table of docs/guide/simulator.md. The meshes are the beams that SOFA was measured on
(tests/xfem/sofa), and larger ones made alike: bricks of five tetrahedra.
"""

from itertools import product
from time import thread_time

import numpy as np
import pytest

from verify.provenance import kernel_seconds
from verify.simulator import Hold, Session, Stage
from verify.xfem.cuts import ToolPath
from verify.xfem.element import isotropic
from verify.xfem.mesh import SimplexMesh

pytestmark = [pytest.mark.timing, pytest.mark.heavy]

FRAME = 1.0 / 60.0  # s
SIZE = np.array([0.1, 0.05, 0.05])  # m
DIVISIONS = [(10, 2, 2), (8, 5, 5), (14, 7, 7), (20, 10, 10), (28, 14, 14)]
FRAMES = 1000  # of which the percentile is, as far as the seconds go
SECONDS = 8.0  # of each row, about
# ms per step of SOFA v26.06, one thread, uncut, steps of 10 ms: polar rotations, at most 100
# iterations of conjugate gradients (1e-9, 1e-8, 4e-5 left)
SOFA = {200: 0.387, 1000: 1.32, 10_000: 11.0}


def beam(divisions: tuple[int, int, int]) -> SimplexMesh:
    """Give a beam of bricks of five tetrahedra, of which every other one is mirrored."""
    count = np.array(divisions) + 1
    points = np.stack(np.meshgrid(*(np.linspace(0, s, n) for s, n in zip(SIZE, count, strict=True)),
                                  indexing="ij"), axis=-1).reshape(-1, 3)  # fmt: skip
    corners = np.array(list(product((0, 1), repeat=3)))
    five = [[0, 3, 5, 6], [1, 0, 3, 5], [2, 0, 3, 6], [4, 0, 5, 6], [7, 3, 5, 6]]
    cells = []
    for brick in product(*map(range, divisions)):
        at = corners.copy()
        if sum(brick) % 2 == 0:
            at[:, 0] = 1 - at[:, 0]
        numbers = np.ravel_multi_index(tuple((at + brick).T), tuple(count))
        cells += [numbers[one] for one in five]
    return SimplexMesh(points, np.array(cells))


def stage(mesh: SimplexMesh, tolerance: float) -> Stage:
    """Hold the beam at one end, and cut it along its length, to half of its depth."""
    held = mesh.points[:, 0] < 1e-9
    tips = [[0.111, 0.021, 0.06], [0.027, 0.033, 0.06]]
    return Stage(
        mesh, isotropic(1e4, 0.3, "solid"), 1000.0, np.array([0.0, -2.0, 0.0]), FRAME, 70 * FRAME,
        [Hold(held, (0, 1, 2), np.zeros(3))], tolerance=tolerance,
        strokes=[ToolPath.of_tip(tips, [0.0, 60 * FRAME], [0.0, 0.0, -0.035])],
    )  # fmt: skip


def measured(played: Stage) -> tuple[Session, dict[bool, np.ndarray]]:
    """Seconds of all frames, by whether they cut: processor time, the first frame left out."""
    Session(played, account=False).step()
    found: dict[bool, list[float]] = {True: [], False: []}
    began = thread_time()
    while min(map(len, found.values())) < FRAMES and thread_time() - began < SECONDS:
        session = Session(played, account=False, clock=thread_time)
        session.run()
        for record in session.records[1:]:
            found[record.newly_split > 0].append(record.total_seconds)
    return session, {cuts: np.array(seconds) for cuts, seconds in found.items()}


def holding(unknowns: list[int], seconds: list[float]) -> float:
    """Unknowns at which a frame takes a 60th of a second, between those that were measured."""
    return float(np.exp(np.interp(np.log(FRAME), np.log(seconds), np.log(unknowns))))


@pytest.mark.parametrize("tolerance", [1e-10, 1e-3])
def test_unknowns_that_hold_60_hz(tolerance, capsys) -> None:
    """The cost of a frame grows little faster than the number of unknowns."""
    rows, unknowns, slow = [], [], {True: [], False: []}
    kernel = 1e3 * np.median(kernel_seconds(5, clock=thread_time))
    for divisions in DIVISIONS:
        mesh = beam(divisions)
        session, seconds = measured(stage(mesh, tolerance))
        cells, took = len(mesh.cells), []
        unknowns.append(session.displacement.size)
        for cuts, found in seconds.items():
            slow[cuts].append(float(np.quantile(found, 0.999)))
            took += [f"{1e3 * np.median(found):.1f}", f"{1e3 * slow[cuts][-1]:.1f} ({len(found)})"]
        rows.append([f"{cells:,}", f"{unknowns[-1]:,}", *took[2:], *took[:2],
                     f"{SOFA.get(cells, '')}"])  # fmt: skip
    with capsys.disabled():
        print(f"\ntolerance {tolerance:g}, kernel {kernel:.1f} ms; ms per frame")
        print("| tetrahedra | unknowns | at rest | 99.9 % (of) | cutting | 99.9 % (of) | SOFA |")
        print("|---|---|---|---|---|---|---|")
        print("\n".join("| " + " | ".join(row) + " |" for row in rows))
        print(f"60 Hz hold, 99.9 % of frames: {holding(unknowns, slow[False]):,.0f} unknowns at "
              f"rest, {holding(unknowns, slow[True]):,.0f} while cutting")  # fmt: skip
    # iterations grow with the cube root, caches hold less; a factorisation's exponent is 2
    assert np.polyfit(np.log(unknowns[1:]), np.log(slow[False][1:]), 1)[0] < 1.6

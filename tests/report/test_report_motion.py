"""Claims about what the report shows of a motion, and about the numbers behind it."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from page_parser import parsed
from synthetic_run import cut_square, make_run

from verify.assess.motion_account import motion_account
from verify.assess.motion_history import motion_history
from verify.compare.hooke import Hooke
from verify.report import render
from verify.report.figures.style import Palette
from verify.scene import Material
from verify.solution import Solution

TIMES = [0.0, 0.25, 0.5, 0.75, 1.0]


def moving_run(root, solvers=("xfem", "conforming"), opens_at=0.4):
    """Make the first case of a run move; every solver has its own energies."""
    make_run(root, pictures=False)
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    result = json.loads(file.read_text())
    model = max((s for s in result["solves"] if s["solver"] == "xfem"), key=lambda s: s["level"])
    result["solves"] = []
    for k, solver in enumerate(solvers):
        kinetic = [(k + 1) * t for t in TIMES]
        strain = [3.0 - value for value in kinetic]
        account = {"time": TIMES, "kinetic": kinetic, "strain": strain, "total": [3.0] * 5,
                   "algorithmic": [0.0] * 5, "linear_momentum_x": [3.0 * t for t in TIMES],
                   "linear_momentum_y": [4.0 * t for t in TIMES],
                   "angular_momentum_z": [-t for t in TIMES]}  # fmt: skip
        series = {"time": TIMES, "displacement_l2": [0.01 * (k + 1) * t for t in TIMES]}
        drift = {"name": "energy_drift", "value": 1e-3, "unit": "1", "reference": None,
                 "uncertainty": 0.0, "source": "ledger of the solution"}  # fmt: skip
        extra = {"solver": solver, "account": account, "series": series}
        result["solves"].append({**model, **extra, "metrics": [*model["metrics"], drift]})
    result["scene"]["cuts"] = [{"kind": "polyline", "opens_at": opens_at}]
    verdict = dict(result["verdicts"][0], metric="energy_drift", verdict="FAIL", limit="at most 0")
    result["verdicts"].append(verdict)
    file.write_text(json.dumps(result))
    return root


def panels(root):
    page = parsed(render(root).read_text(encoding="utf-8"))
    return page, [svg["aria-label"] for svg in page.all("svg") if svg.get("class") == "profile"]


def test_errors_energies_and_momenta_of_every_solver_are_drawn_over_time(tmp_path):
    _, labels = panels(moving_run(tmp_path / "run"))
    assert len(labels) == 6  # an error, two ledgers, the total, two momenta
    (ledger,) = [text for text in labels if text.startswith("XFEM: energies")]
    assert "kinetic: 0 to 1" in ledger
    assert "strain: 3 to 2" in ledger
    assert "algorithmic" not in ledger  # zero throughout
    (linear,) = [text for text in labels if "linear momentum" in text]
    assert "XFEM: 0 to 5" in linear  # |(3, 4)|
    (total,) = [text for text in labels if "change of the total" in text]
    assert "conforming P1: 0 to 0" in total


def test_the_instant_of_a_cut_is_marked_in_every_panel(tmp_path):
    page, labels = panels(moving_run(tmp_path / "run"))
    assert all("A cut opens at 0.4 s." in label for label in labels)
    assert "a cut opens (0.4 s)" in page.text


def test_a_cut_that_is_there_from_the_start_is_no_event(tmp_path):
    panels(moving_run(tmp_path / "run", opens_at=0.0))
    assert "cut opens" not in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_twelve_solvers_are_in_one_panel_each_with_a_line_of_its_own(tmp_path):
    names = ("xfem", "conforming", *"abcdefghij")
    _, labels = panels(moving_run(tmp_path / "run", names))
    (label,) = [text for text in labels if text.startswith("relative L² error")]
    titles = ("XFEM", "conforming P1", *names[2:])
    assert all(f"{title}: 0 to" in label for title in titles)
    palette = Palette()
    styles = [palette[title] for title in titles]
    assert len({style.colour for style in styles}) == 12
    assert len({(style.marker, style.hollow) for style in styles}) == 12
    assert len({style.dashes for style in styles}) == 12


def test_energy_verdicts_stand_beside_what_is_kept(tmp_path):
    page, _ = panels(moving_run(tmp_path / "run"))
    kept = page.text.partition("Drifts of energy and momenta")[2]
    assert "FAIL" in kept[:700]
    assert "at most 0" in kept[:700]


def test_a_static_case_has_no_panels_over_time(plain_run):
    assert "Over time" not in (plain_run / "report.html").read_text(encoding="utf-8")


def test_momenta_of_a_rigid_motion_are_mass_times_velocity_and_inertia_times_spin():
    body = cut_square(4, opening=0.0)
    points, spin, velocity, density = body.points, 2.0, np.array([0.3, -0.1]), 5.0
    turned = np.column_stack([-points[:, 1], points[:, 0]]) * spin
    speed = np.stack([turned, turned + velocity])
    ledger = {"kinetic": np.array([1.0, 2.0]), "strain": np.array([2.0, 1.0]),
              "work_of_loads": np.array([0.0, 0.5])}  # fmt: skip
    solution = Solution(points=points, cells=body.cells, displacement=np.zeros((2, *points.shape)),
                        times=np.array([0.0, 1.0]), velocity=speed, ledger=ledger)  # fmt: skip
    scene = SimpleNamespace(
        material=Material(young=1.0, poisson=0.3, plane="strain", density=density),
        loads=[SimpleNamespace()],
    )
    found = motion_history(motion_account(scene, solution, Hooke(1.0, 1.0)))
    corners = points[body.cells]
    area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
    middle = (area[:, None] * corners.mean(axis=1)).sum(axis=0)
    expected = density * spin * np.array([-middle[1], middle[0]])
    assert found["linear_momentum_x"][0] == pytest.approx(expected[0], rel=1e-12)
    gained = [found[f"linear_momentum_{a}"][1] - found[f"linear_momentum_{a}"][0] for a in "xy"]
    assert gained == pytest.approx(density * area.sum() * velocity, rel=1e-12)
    # ∫ |x|² = A/12 (Σ xi·xi + Σ xi·xj) on a triangle
    products = np.einsum("mia,mja->mij", corners, corners)
    second = area / 12 * (np.trace(products, axis1=1, axis2=2) + products.sum(axis=(1, 2)))
    assert found["angular_momentum_z"][0] == pytest.approx(density * spin * second.sum(), rel=1e-12)
    assert found["total"] == pytest.approx([3.0, 2.5])
    assert motion_history(motion_account(scene, body, Hooke(1.0, 1.0))) == {}

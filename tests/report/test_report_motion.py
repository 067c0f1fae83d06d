"""Claims about what the report shows of a motion, and about the numbers behind it."""

import json

from page_parser import parsed
from synthetic_run import make_run

from verify.report import render

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
    assert len(labels) == 6  # an error, kinetic and strain energy, the total, two momenta
    (kinetic,) = [text for text in labels if text.startswith("kinetic")]
    assert "XFEM: 0 to 1" in kinetic
    assert "conforming P1: 0 to 2" in kinetic
    assert not any("scheme" in text for text in labels)  # zero throughout
    (linear,) = [text for text in labels if "linear momentum" in text]
    assert "XFEM: 0 to 5" in linear  # |(3, 4)|
    (total,) = [text for text in labels if "change of the total" in text]
    assert "conforming P1: 0 to 0" in total


def test_an_error_below_the_uncertainty_of_its_reference_is_named_and_not_drawn(tmp_path):
    root = moving_run(tmp_path / "run")
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    result = json.loads(file.read_text())
    for solve, width in zip(result["solves"], (0.02, 1e-4), strict=True):  # errors 0.01 and 0.02
        largest = {"name": "displacement_l2_max", "value": max(solve["series"]["displacement_l2"]),
                   "unit": "1", "reference": None, "uncertainty": width, "source": ""}  # fmt: skip
        solve["metrics"].append(largest)
    file.write_text(json.dumps(result))
    page, labels = panels(root)
    (drawn,) = [text for text in labels if "L² error" in text]
    assert "conforming P1: 0 to 0.02" in drawn
    assert "XFEM" not in drawn
    assert "not above the uncertainty of the comparison: " in page.text

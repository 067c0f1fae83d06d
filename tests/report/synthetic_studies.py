"""Records of small studies of every kind whose page is not tested with the study itself."""

import json
from pathlib import Path

HOSTILE = "a|b <script>alert(1)</script> `x` *y*"
FINDING = {"topic": HOSTILE, "sentence": "Seen: 2 of 3.", "expected": "all", "verdict": "FAIL"}
POINT = {"level": 0, "unknowns": 1200, "error": 0.125, "seconds": 0.25, "memory": 2e8,
         "phases": {"solve": 0.0025}}  # fmt: skip


def measured(solver, size, quantity, value, reason=""):
    return {"family": "f", "solver": solver, "size": size, "quantity": quantity, "unit": "",
            "value": value, "reason": reason}  # fmt: skip


STUDIES = {
    "slivers": {
        "measurements": [
            measured("xfem", size, name, value, "" if value else "did not finish")
            for size in (0.1, 1e-3, 0.0)
            for name, value in (
                ("critical explicit step", 0.899 * size or None),
                ("critical explicit step, uncut", 0.1),
                ("condition number scaled by the diagonal", 1004.0),
                ("displacement_l2", 0.01),
            )
        ],
        "growths": [
            {"family": "f", "solver": "xfem", "quantity": "displacement_l2", "exponent": -0.001}
        ],
    },
    "energy": {"measurements": [measured("xfem scheme=x", None, "energy_drift", 2.5e-13)]},
    "cost": {
        "metric": "energy_norm",
        "front": [["mine", 0]],
        "running": {"xfem": [[0.5, 0.4, 0.6], None], "mine": [[0.25, 0.2, 0.3]] * 2},
        "steps": [{"step": 1, "error": 0.125, "times": {"xfem": [0.5, 0.4, 0.6]}},
                  {"step": 2, "error": 0.25, "times": {}}],
        "points": [POINT | {"solver": "xfem"}, POINT | {"solver": "mine", "error": 0.0625}],
        "left_out": [{"case": "c", "solver": "mine", "level": 2, "status": "timeout",
                      "reason": HOSTILE}],
    },
    "budget": {
        "level": 1,
        "tolerance": 0.05,
        "metric": "displacement_l2",
        "chain": ["one", "two"],
        "notes": [HOSTILE],
        "missing": [{"source": "s", "reason": "r", "where": "w"}],
        "budgets": [{
            "metric": "displacement_l2",
            "parts": [{"source": "mesh", "value": -0.0203, "uncertainty": 0.001}],
            "total": {"source": "total", "value": 0.0, "uncertainty": 0.0, "round_off": True},
        }],
        "candidates": [
            {"kinematics": "linear", "choices": "", "level": 0, "reason": "it ran away",
             "high": None},
            {"kinematics": "finite", "choices": "", "level": 0, "reason": "", "size": 0.1,
             "unknowns": 10, "error": 0.0204, "low": 0.02, "high": 0.021, "seconds": 0.5,
             "fastest": 0.4, "slowest": 0.6},
        ],
    },
    "thesis": {
        "face": [{
            "asked": 10, "cuts": 10, "strokes": 1, "step": {"xfem": 1.0},
            "thesis": {"xfem": 16, "snapping_subdivision": 20},
            "added": {"xfem": 8, "snapping_subdivision 0.02": 19, "snapping_subdivision 0.2": 13},
        }],
        "steps": [
            {"asked_tetrahedra": 200, "tetrahedra": 207, "asked_cuts": n, "cuts": n, "nodes": n,
             "thesis_nodes": n, "step": 7.5e-4, "per_second": 1.5e-3,
             "thesis_per_second": 0.28435}
            for n in (0, 50)
        ],
        "delays": [
            {"tetrahedra": n, "speed_name": "slow", "speed": 0.0104, "elements": 138, "edge": 0.016,
             "delay": 0.7124, "seen": 0.7218, "thesis": 0.7124}
            for n in (200, 400)
        ],
        "hand": {
            "tetrahedra": 1005, "cuts": 243, "unknowns": 1674, "steps": 276, "cutting_steps": 43,
            "within": {"1 ms": 0.25, "2 ms": 0.5}, "within_wall": {"1 ms": 0.0, "2 ms": 0.125},
            "resting": {"step": 2.44e-3}, "cutting": {"step": 0.0231},
        },
        "contended": "", "published": {"source": HOSTILE},
    },
    "calibration": {"trials": [
        {"family": "airy", "scene": 0, "degree": 1, "level": 2, "quantity": "jump_l2",
         "stated": 2e-3, "true": 1e-3, "ratio": 2.0, "covered": True, "left_out": ""},
    ]},
}  # fmt: skip


def make_studies(folder: Path) -> Path:
    """Write the record of each study into `folder`."""
    for kind, own in STUDIES.items():
        record = {"schema": 1, "kind": f"{kind} study", "command": "verify study", "seconds": 1.0,
                  "provenance": {"date": "today"}, "findings": [FINDING], **own}  # fmt: skip
        (folder / f"{kind}.json").write_text(json.dumps(record), encoding="utf-8")
    return folder

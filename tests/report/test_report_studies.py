"""Claims about the pages of studies: both forms from one record, its numbers, no markup."""

import json

import pytest
from page_parser import parsed

from verify.cli import main
from verify.errors import InputError
from verify.report.study_page import render_study

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
        "steps": [
            {"step": 1, "error": 0.125, "times": {"xfem": [0.5, 0.4, 0.6]}},
            {"step": 2, "error": 0.25, "times": {}},
        ],
        "points": [POINT | {"solver": "xfem"}, POINT | {"solver": "mine", "error": 0.0625}],
        "left_out": [
            {"case": "c", "solver": "mine", "level": 2, "status": "timeout", "reason": HOSTILE}
        ],
    },
    "budget": {
        "level": 1,
        "tolerance": 0.05,
        "metric": "displacement_l2",
        "chain": ["one", "two"],
        "notes": [HOSTILE],
        "missing": [{"source": "s", "reason": "r", "where": "w"}],
        "budgets": [
            {
                "metric": "displacement_l2",
                "parts": [{"source": "mesh", "value": -0.0203, "uncertainty": 0.001}],
                "total": {"source": "total", "value": 0.0, "uncertainty": 0.0, "round_off": True},
            }
        ],
        "candidates": [
            {
                "kinematics": "linear",
                "choices": "",
                "level": 0,
                "reason": "it ran away",
                "high": None,
            },
            {
                "kinematics": "finite",
                "choices": "",
                "level": 0,
                "reason": "",
                "size": 0.1,
                "unknowns": 10,
                "error": 0.0204,
                "low": 0.02,
                "high": 0.021,
                "seconds": 0.5,
                "fastest": 0.4,
                "slowest": 0.6,
            },
        ],
    },
    "calibration": {
        "trials": [
            {
                "family": "airy",
                "scene": 0,
                "degree": 1,
                "level": 2,
                "quantity": "jump_l2",
                "stated": 2e-3,
                "true": 1e-3,
                "ratio": 2.0,
                "covered": True,
                "left_out": "",
            }
        ],
    },
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies")
    for kind, own in STUDIES.items():
        record = {"schema": 1, "kind": f"{kind} study", "command": "verify study", "seconds": 1.0,
                  "provenance": {"date": "today"}, "findings": [FINDING], **own}  # fmt: skip
        (folder / f"{kind}.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


@pytest.mark.parametrize("kind", STUDIES)
def test_page_and_markdown_say_the_same_and_no_text_of_a_record_becomes_markup(studies, kind):
    text = render_study(studies, kind).read_text(encoding="utf-8")
    page = parsed(text)
    assert HOSTILE in page.text
    assert "alert(1)</script>" not in text
    markdown = render_study(studies, kind, "markdown").read_text(encoding="utf-8")
    assert "a\\|b &lt;script&gt;alert(1)&lt;/script&gt; \\`x\\` \\*y\\*" in markdown
    for said in ("1 finding: 0 passed, 1 failed, 0 undecided.", "Seen: 2 of 3."):
        assert said in page.text
        assert said in markdown
    assert markdown.count("![") == len(page.all("svg"))
    assert all((studies / name).is_file() for name in pictures(markdown))


def pictures(markdown):
    return [part.split(")")[0] for part in markdown.split("](")[1:]]


def test_numbers_of_studies_are_those_of_the_record(studies):
    texts = {k: render_study(studies, k).read_text(encoding="utf-8") for k in STUDIES}
    for kind, said in (
        ("slivers", "◐ 0.899"), ("slivers", "◐ 1004"),
        ("slivers", "∝ ε^0.00"), ("energy", "XFEM scheme=x"), ("energy", "2.50×10⁻¹³"),
        ("cost", "500 ms (400–600)"), ("cost", "not reached"), ("cost", "2.5 ms"),
        ("budget", "−2.03 %"), ("budget", "round-off"), ("budget", "it ran away"),
        ("calibration", "2.00"), ("calibration", "1 marks, 0 not covered"),
    ):  # fmt: skip
        assert said in texts[kind], (kind, said)


def test_every_study_of_a_directory_is_rendered_again_in_the_form_that_is_asked_for(
    studies, capsys
):
    assert main(["report", str(studies), "--format", "markdown"]) == 0
    assert capsys.readouterr().out.count("report: ") == len(STUDIES)


def test_a_record_of_another_kind_is_one_line(studies, tmp_path):
    (tmp_path / "cost.json").write_text((studies / "budget.json").read_text())
    with pytest.raises(InputError, match="kind is"):
        render_study(tmp_path, "cost")

"""The page of a foreign engine: its numbers are the run's, and made by hand."""

import re

from verify.judge.pairs import pairs_of
from verify.report.benchmark_page import METRIC, RIVALS, write_engine
from verify.result import CaseResult, Metric, ReferenceRecord, SolveRecord, Status

NOTES = {"version": "v9", "scheme": "implicit Euler", "mass": "lumped",
         "rotation": "polar decomposition of the corners"}  # fmt: skip


def case(name, moving, engine, own=0.02, half=1e-5):
    """Two levels of each solver; ``engine`` is its error on the finest, or why it refuses."""
    solves = []
    for solver, error in (("sofa", engine), ("xfem", own), ("conforming", 0.01)):
        for level, h in enumerate((0.1, 0.05)):
            if isinstance(error, str):
                solves.append(SolveRecord(name, solver, level, Status.REFUSED, error))
                continue
            metric = Metric(METRIC, error * (h / 0.05) ** 2, "1", uncertainty=half)
            solves.append(SolveRecord(
                name, solver, level, Status.SOLVED, size=h, unknowns=10, metrics=[metric],
                timings={"solve": [2.0, 2.0, 2.0]}, notes=NOTES,
                iterations={"steps": 500} if moving else {},
            ))  # fmt: skip
    kinematics = "corotational" if name == "dynamics/two" else "linear"
    kind = "dynamic" if moving else "static"
    cuts = [{"kind": "tool_path"}] if name == "dynamics/one" else []
    scene = {"cuts": cuts, "analysis": {"kind": kind, "kinematics": kinematics}}
    return CaseResult(name, name, "", "0", scene, ReferenceRecord(), solves, [], [])


def test_rows_answers_and_refusals_are_those_of_the_run(tmp_path):
    results = [
        case("dynamics/one", True, 0.04), case("dynamics/two", True, 0.08),
        case("statics/one", False, 0.02), case("statics/blurred", False, 0.03, half=0.05),
        case("statics/other", False, "membranes are not offered"),
    ]  # fmt: skip
    pairs = pairs_of(results, ["sofa", *RIVALS])
    write_engine(results, pairs, "verify run x", "0123456789", tmp_path, "sofa", ["dynamics/two"])
    page = (tmp_path / "index.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\| (dynamics|statics)/", line)]
    assert [row.replace("\N{NO-BREAK SPACE}", "~") for row in rows] == [
        "| statics/one | 0.0200 | 0.0200 | 0.0100 | 2.0~s | 2.0~s | 2.0~s |",
        "| statics/blurred | ≈ | ≈ | ≈ | 2.0~s | 2.0~s | 2.0~s |",
        "| dynamics/one | 0.0400 | 0.0200 | 0.0100 | 4.0~ms | 4.0~ms | 4.0~ms |",
        "| dynamics/two | 0.0800 | 0.0200 | 0.0100 | 4.0~ms | 4.0~ms | 4.0~ms |",
    ]
    moving = next(line for line in page.splitlines() if line.startswith("- **In motion**"))
    # 0.5 and 0.25 of the engine's error: geometric mean, least and largest
    assert "error is 0.35 [0.25, 0.50] times SOFA's over 2 scenes (2 won, 0 tied, 0 lost)" in moving
    assert "- membranes are not offered (statics/other)" in page
    assert "at commit 01234567: `verify run x`" in page
    assert "SOFA has the polar decomposition of the corners (dynamics/two)." in page
    assert "Where a blade cuts (dynamics/one), SOFA's facets open when it has passed them" in page
    assert "timed once" not in page
    assert "SOFA v9: implicit Euler, mass lumped" in page
    assert len(list((tmp_path / "sofa-pictures").glob("*.svg"))) == 1

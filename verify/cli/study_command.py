"""``verify study``: what slivers do, whether energy is kept, what accuracy costs."""

import argparse
import json
import shlex
import sys
from collections.abc import Callable
from dataclasses import asdict
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from verify.study.cost import CostStudy

__all__ = ["execute"]


def _cost(arguments: argparse.Namespace, announce: Callable[[str], None]) -> "CostStudy":
    """Solve every step of the cut through the runner, whose directory is kept, and compare."""
    from verify.cli.progress import progress_on
    from verify.runner import Options, run_cases
    from verify.runner.checking import check_solver_name
    from verify.runner.reference_cache import cache_folder
    from verify.scene import load_scene
    from verify.study.cost import cost_study, growing_scenes

    scene = load_scene(arguments.case)
    solvers = tuple(dict.fromkeys(arguments.solvers)) or ("xfem", "conforming")
    for name in solvers:
        check_solver_name(name, "--solver")
    scenes = growing_scenes(scene, arguments.steps)
    options = Options(
        solvers=solvers,
        repetitions=arguments.repetitions,
        # on the other mesh of this solver only the cut cells are made anew
        parameters={"conforming": {"mesh": "remeshed"}} if "conforming" in solvers else {},
        cache=cache_folder(),
    )
    start = perf_counter()
    folder = arguments.out / f"cost-{scene.name.replace('/', '__')}"
    announce(f"{len(scenes)} steps of the cut '{scene.cuts[0].name}', into {folder}")
    with progress_on(sys.stderr) as progress:
        results = run_cases(scenes, folder, options, progress).results
    return cost_study(scene.name, results, arguments.metric, perf_counter() - start)


def execute(arguments: argparse.Namespace) -> int:
    """Run a study, write its record and table, render its page."""
    from verify.report.study_page import render_study
    from verify.result import Verdict
    from verify.study.record import make_directory, write_study

    def announce(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    make_directory(arguments.out)  # before minutes of work
    command = shlex.join(["verify", *sys.argv[1:]])
    if arguments.study == "cost":
        cost = _cost(arguments, announce)
        findings, record, rows = cost.findings, cost.as_record(), cost.rows()
    elif arguments.study == "slivers":
        from verify.study.slivers import sliver_study

        dimensions = (arguments.dimension,) if arguments.dimension else (2, 3)
        slivers = sliver_study(dimensions, arguments.quick, announce)
        findings, record = slivers.findings, slivers.as_record()
        rows = [asdict(m) for m in slivers.measurements]
    else:
        from verify.study.energy import energy_study

        energy = energy_study(arguments.quick, announce)
        findings, record, rows = energy.findings, energy.as_record(), energy.rows()
    written = write_study(arguments.out, arguments.study, record, rows, command)
    page = render_study(arguments.out, arguments.study)
    if arguments.json:
        said = [asdict(finding) for finding in findings]
        print(json.dumps({"record": str(written), "report": str(page), "findings": said}, indent=2))
        return 0
    for finding in findings:
        mark = {Verdict.PASS: "as expected", Verdict.FAIL: "NOT KEPT"}.get(
            finding.verdict, str(finding.verdict)
        )
        print(f"{mark}: {finding.topic}: {finding.sentence} [expected: {finding.expected}]")
    print(f"report: {page}")
    return 0

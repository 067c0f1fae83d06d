"""The table of ``verify conform``: which checks a solver passes."""

import argparse
import json
import sys
from dataclasses import asdict

from verify.cli.solver_parameters import of_one_solver
from verify.cli.waiting import said_to_wait
from verify.conformance import CheckResult, conform, exit_code_of
from verify.solvers.named import one_name, parameters_of, solver_in


def execute(arguments: argparse.Namespace) -> int:
    """Run the suite on one solver and print a line per check."""
    name = one_name(arguments.solver)
    parameters = parameters_of(name, {solver_in(name): of_one_solver(arguments.parameters)})
    with said_to_wait(sys.stderr, f"conformance of {name}"):
        results = conform(name, parameters, arguments.timeout, arguments.checks)
    code = exit_code_of(results)
    if arguments.json:
        checks = [asdict(result) for result in results]
        answer = {"solver": name, "parameters": parameters, "exit": code}
        print(json.dumps({**answer, "checks": checks}, indent=2))
        return code
    width = max(len(result.name) for result in results)
    for result in results:
        print(f"{result.name:<{width}}  {result.state:<8} {_number(result):<19} {result.claim}")
        if result.reason:
            print(f"{'':<{width}}  {result.reason}")
    return code


def _number(result: CheckResult) -> str:
    if result.observed is None or result.limit is None:
        return ""
    return f"{result.observed:.1e} ≤ {result.limit:.1e}" if result.state == "pass" else (
        f"{result.observed:.1e} > {result.limit:.1e}"
    )  # fmt: skip

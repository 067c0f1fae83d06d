"""``verify solvers``: names of all solvers; of those of others, whether they are here."""

import argparse
import json
from typing import Any

from verify.foreign import foreign_solvers, install, remove, state_of
from verify.solvers.interface import solver_names


def execute(arguments: argparse.Namespace) -> int:
    """List, install or remove."""
    if arguments.action == "install":
        state = install(arguments.name, arguments.python)
        print(f"{arguments.name} {state.version} is installed; its Python is {state.python}")
        return 0
    if arguments.action == "remove":
        print(f"removed {remove(arguments.name)}")
        return 0
    rows: list[dict[str, Any]] = []
    for name, solver in foreign_solvers().items():
        state = state_of(solver)
        said = {"title": solver.title, "licence": solver.licence, "source": solver.source}
        rows.append({"name": name, **said, "parameters": solver.parameters, **vars(state)})
    if arguments.json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return 0
    others = [name for name in solver_names() if name not in {row["name"] for row in rows}]
    print(f"of the project, and plugged in: {', '.join(others)}")
    for row in rows:
        here = f"{row['version']}, {row['python']}" if row["python"] else "not installed"
        print(f"{row['name']}  {row['title']}  [{row['licence']}]  {here}")
        if row["missing"]:
            print(f"  {row['missing']}")
        if row["parameters"]:
            given = ", ".join(f"{key}={value}" for key, value in row["parameters"].items())
            print(f"  --set {row['name']}.NAME=VALUE: {given}")
    return 0

"""List, install or remove solvers of others.

Examples
--------
  verify solvers list
  verify solvers install ngsxfem
  verify run statics/f3_inclined --solver xfem --solver ngsxfem --out out
  verify solvers remove ngsxfem

Each has a virtual environment of its own, in $VERIFY_SOLVERS or else below the user's
data folder; its packages are locked by their hashes. Exit code 2 if an installation
fails; nothing of it is left then.
"""

from typing import Annotated, Any

from verify.cli.signatures import Actions, Arg, AsJson
from verify.cli.streams import print_answer

Name = Annotated[str, Arg("NAME", help="name of the solver")]


def list_(*, as_json: AsJson = False) -> int:
    """Say which there are, and which are here."""
    from verify.foreign import foreign_solvers, state_of
    from verify.solvers.interface import solver_names

    rows: list[dict[str, Any]] = []
    for name, solver in foreign_solvers().items():
        state = state_of(solver)
        about = {"title": solver.title, "licence": solver.licence, "source": solver.source}
        rows.append({"name": name, **about, "parameters": solver.parameters, **vars(state)})
    others = [name for name in solver_names() if name not in {row["name"] for row in rows}]
    lines = [f"of the project, and plugged in: {', '.join(others)}"]
    for row in rows:
        here = f"{row['version']}, {row['python']}" if row["python"] else "not installed"
        lines.append(f"{row['name']}  {row['title']}  [{row['licence']}]  {here}")
        lines += [f"  {row['missing']}"] if row["missing"] else []
        if row["parameters"]:
            given = ", ".join(f"{key}={value}" for key, value in row["parameters"].items())
            lines.append(f"  --set {row['name']}.NAME=VALUE: {given}")
    return print_answer(as_json, rows, lines, ensure_ascii=False)


def install(name: Name, *, python: Annotated[str | None, Arg("PYTHON")] = None) -> int:
    """Install one from its locked packages.

    Parameters
    ----------
    python
        interpreter to use; of a package of the system, the one that has it
    """
    from verify.foreign import install

    state = install(name, python)
    print(f"{name} {state.version} is installed; its Python is {state.python}")
    return 0


def remove(name: Name) -> int:
    """Remove an installed one."""
    from verify.foreign import remove

    print(f"removed {remove(name)}")
    return 0


ACTIONS = Actions((list_, install, remove), default=list_)

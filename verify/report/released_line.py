"""Energy that a blade released, by what became of it: one line per solver."""

from verify.report.notation import number, solver_title
from verify.result import SolveRecord

__all__ = ["released_line"]

_PARTS = {
    "released_to_scheme": "dissipated by the scheme",
    "released_to_damping": "by damping",
    "released_to_kinetic": "left as kinetic energy beside the exact field",
    "released_to_strain": "as strain energy beside it",
    "released_to_short_waves": "left as kinetic energy of waves shorter than four elements",
}


def released_line(solve: SolveRecord) -> str:
    """Say where the energy went, per unit advance; empty if no blade advances."""
    found = {name: m.value for name in _PARTS if (m := solve.metric(name)) is not None}
    lacking = {name: why for name in _PARTS if (why := solve.notes.get(name))}
    if not found and not lacking:
        return ""
    whole = solve.metric("released")
    rate = None if whole is None else whole.value
    said = [f"{_amount(value, rate)} {_PARTS[name]}" for name, value in found.items()]
    said += [f"{_PARTS[name]}: unavailable ({why})" for name, why in lacking.items()]
    of = "" if whole is None else f"of the {number(whole.value, 3)} J/m² released "
    return f"{solver_title(solve.solver)}: {of}per unit advance of the blade: {', '.join(said)}."


def _amount(value: float, whole: float | None) -> str:
    if not whole:
        return f"{number(value, 3)} J/m²"
    # round-off of nothing is nothing
    return f"{round(100 * value / whole) + 0:d} %"

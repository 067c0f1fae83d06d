"""Energy that a blade released, by what became of it: one row per solver."""

from collections.abc import Sequence

from verify.report.blocks import Cell, Table, plain_table
from verify.report.notation import number, solver_title
from verify.result import SolveRecord

_PARTS = {
    "released_to_scheme": "dissipated by the scheme",
    "released_to_damping": "by damping",
    "released_to_kinetic": "kinetic energy beside the exact field",
    "released_to_strain": "strain energy beside it",
    "released_to_short_waves": "kinetic energy of waves shorter than four elements",
}


def released_table(solves: Sequence[SolveRecord]) -> Table | None:
    """Return where the energy went, per unit advance of the blade; None if no blade advances."""
    cells = [(solve, {name: _cell(solve, name) for name in _PARTS}) for solve in solves]
    shown = [name for name in _PARTS if any(own[name] for _, own in cells)]
    rows = []
    for solve, own in cells:
        whole = solve.metric("released")
        released = "–" if whole is None else number(whole.value, 3)
        if any(own.values()):
            parts = [own[name] or "–" for name in shown]
            rows.append([solver_title(solve.solver), released, *parts])
    head = ["solver", "released", *(_PARTS[name] for name in shown)]
    caption = "Energy released per unit advance of the blade, J/m², and what became of it"
    return plain_table(caption, head, rows, "prose") if rows else None


def _cell(solve: SolveRecord, name: str) -> Cell | None:
    """Return a part in J/m², or as a share of what was released; or why there is none."""
    if why := solve.notes.get(name):
        return Cell("unavailable", why)
    part, whole = solve.metric(name), solve.metric("released")
    if part is None:
        return None
    if whole is None or not whole.value:
        return Cell(number(part.value, 3))
    # round-off of nothing is nothing
    return Cell(f"{round(100 * part.value / whole.value) + 0:d} %")

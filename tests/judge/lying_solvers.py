"""Solutions whose velocities gain or lose energy, with ledgers that hide it in one part each."""

from dataclasses import replace

import numpy as np

PARTS = {
    "kinetic": -1.0, "strain": -1.0, "gravity": -1.0, "damping": -1.0, "algorithmic": -1.0,
    "work_of_loads": 1.0, "work_of_supports": 1.0,
}  # fmt: skip


def faster(solution, kinetic_growth):
    """The same places with velocities whose kinetic energy grows linearly by a factor."""
    growth = np.sqrt(np.linspace(1.0, kinetic_growth, len(solution.times)))
    return replace(solution, velocity=solution.velocity * growth[:, None, None])


def hidden(solution, kinetic_growth, part):
    """Velocities that gain, and a ledger that closes: `part` has what is gained."""
    own = {name: np.asarray(row) for name, row in solution.ledger.items() if name in PARTS}
    growth = np.linspace(1.0, kinetic_growth, len(solution.times))
    gained = (growth - 1.0) * own["kinetic"]
    if part != "kinetic":  # that one is left as it was
        own["kinetic"] = own["kinetic"] + gained
        own[part] = own.get(part, 0.0 * gained) + PARTS[part] * gained
    return replace(faster(solution, kinetic_growth), ledger=own)

"""Keys, values and commands that were removed, and what to use instead."""

_INSTEAD = {
    "geometry.source": (
        "shapes are made by formulas; for real anatomy give its surface as 'file' "
        "(docs/guide/simulator.md)"
    ),
    "verify data": (
        "for real anatomy give its surface as 'file' of [geometry] (docs/guide/simulator.md)"
    ),
    "xfem.basis": "leave it out; all bases span the space of the side-wise unknowns",
}


def instead(name: str) -> str:
    """Say what to use instead of what was removed under `name`, or ""."""
    return f"'{name}' was removed: {_INSTEAD[name]}" if name in _INSTEAD else ""

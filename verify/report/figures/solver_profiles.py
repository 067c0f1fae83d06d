"""Performance and data profiles: the share of cases that each solver has done, over a number."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.blocks import Figure
from verify.report.figures.style import Palette, drawing, legend, log_axis, log_range, panel
from verify.report.notation import solver_title


def profiles_figure(profiles: Sequence[Mapping[str, Any]]) -> Figure | None:
    """Return a panel for each profile of a ranking; None if no item was compared."""
    palette, panels = Palette(), []
    for one in profiles:
        steps: Mapping[str, Sequence[float]] = one["steps"]
        most = one.get("most") or float("inf")
        every = [value for own in steps.values() for value in own if 0.0 < value <= most]
        if one["items"] < 2 or not every:
            continue
        ends = log_range(every)
        with panel(one["quantity"], 5.6, 3.0) as (figure, axes):
            for solver, own in steps.items():
                label, shares = (
                    solver_title(solver),
                    [k / one["items"] for k in range(len(own) + 1)],
                )
                style = palette[label]
                axes.step(
                    [ends[0], *own, ends[1]], [*shares, shares[-1]], where="post", label=label,
                    color=style.colour, linestyle=style.dashes,
                )  # fmt: skip
            log_axis(axes, "x", ends)
            axes.set_ylim(0.0, 1.03)
            axes.set_xlabel(one["quantity"].partition(",")[0])
            axes.set_ylabel(f"share of {one['items']} cases")
            legend(axes)
            said = "; ".join(f"{name}: {len(own)}" for name, own in steps.items())
            panels.append(
                drawing(figure, f"{one['quantity']}, cases done of {one['items']}. {said}")
            )
    if not panels:
        return None
    said = (
        "Profiles: the share of the cases in which a solver stays within the number on the axis. "
        "Refused, failed and uncompared cases are never reached."
    )
    return Figure(panels, said)

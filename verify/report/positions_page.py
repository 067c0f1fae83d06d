"""The page of a study of positions: who differs wherever the mesh lies, tables of each scene."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from verify.report.notation import Cell, Drawing, Lead, Table, metric_title, solver_title
from verify.report.plots import Palette, Strip, strips
from verify.report.sliver_page import listed

_ALL = "all"  # scenes together
_FEWEST = (6, 16)  # scenes and meshes of the protocol
_NORMS_IN_WORDS = {"displacement_l2": "displacement", "energy_norm": "energy norm"}


def positions_view(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer, ratios to one solver as strips, and tables over all scenes and each."""
    measure, palette, short = record["measure"], Palette(), _short(record["scenes"])
    panels, tables = [], []
    for metric in dict.fromkeys(pair["metric"] for pair in record["pairs"]):
        own = listed(record["pairs"], metric=metric, rival=measure)
        strip = []
        for pair in listed(own, scene=_ALL):
            (found,) = listed(record["ratios"], metric=metric, solver=pair["solver"])
            ends = pair["ratio"], pair["low"], pair["high"]
            strip.append(Strip(solver_title(pair["solver"]), found["ratios"], *ends))
        title = f"{metric_title(metric)}, over that of {solver_title(measure)}"
        panels.append(strips(title, strip, palette) if strip else None)
        places = [_ALL, *record["scenes"]]
        rows = []
        for solver in dict.fromkeys(pair["solver"] for pair in own):
            known = {pair["scene"]: pair for pair in listed(own, solver=solver)}
            cells = [Cell(_ratio(known[place]), strong=known[place]["differs"])
                     if place in known else "–" for place in places]  # fmt: skip
            rows.append([solver_title(solver), *cells])
        heads = ["solver", *(short.get(place, place) for place in places)]
        tables.append(Table(title, heads, rows, "", True))
    levels = dict.fromkeys(record["scenes"].values())
    at = [
        f"level {level}: "
        + ", ".join(
            f"{short[name]} ({name})" for name, its in record["scenes"].items() if its == level
        )
        for level in levels
    ]
    scenes = f"Scenes, at {'; at '.join(at)}."
    return {"lead": positions_lead(record, panels), "scenes": scenes, "tables": tables}


def _short(scenes: Iterable[str]) -> dict[str, str]:
    """Return a head for the column of each scene: C2 of the benchmark's, else without the folder.

    Where two would share it, all keep their names.
    """
    short = {name: re.sub(r"^benchmark/c(\d+)_.*", r"C\1", name).split("/")[-1] for name in scenes}
    return short if len({*short.values()}) == len(short) else {name: name for name in short}


def positions_lead(record: Mapping[str, Any], panels: Sequence[Drawing | None] = ()) -> Lead:
    """Return which solvers differ wherever the mesh lies: of all pairs, and beside the measure."""
    scenes, positions, measure = record["scenes"], record["positions"], record["measure"]
    over_all = listed(record["pairs"], scene=_ALL)
    counts = []
    for metric, words in _NORMS_IN_WORDS.items():  # each pair stands there both ways
        every = [p for p in listed(over_all, metric=metric) if p["solver"] < p["rival"]]
        differ = sum(pair["differs"] for pair in every)
        counts.append(f"{differ} of {len(every)} differ in the error of the {words}")
    count = f"{len(scenes)} scene{'s' * (len(scenes) != 1)}"
    first = f"Of all pairs of solvers, over {count} on {positions} meshes each, "
    first += f"{' and '.join(counts)}."
    if len(scenes) < _FEWEST[0] or positions < _FEWEST[1]:
        first += f" Nothing is claimed from fewer than {_FEWEST[0]} scenes on {_FEWEST[1]} meshes."
    own, said = listed(over_all, metric="displacement_l2", rival=measure), []
    for differ, words in ((True, "these differ"), (False, "these are not told apart")):
        names = [f"{solver_title(p['solver'])} {_ratio(p)}" for p in listed(own, differs=differ)]
        if names:
            said.append(f"{words}: {', '.join(names)}")
    second = f"From {solver_title(measure)}, by the displacement (median ratio, range of 90 %), "
    second += "; ".join(said) or "no solver has a ratio"
    kinds = {name.split("/")[0] for name in scenes}
    where = f"{count} of {len(kinds)} kinds" if len(kinds) > 1 else f"scenes of {min(kinds)}"
    where = "the benchmark's scenes" if kinds == {"benchmark"} else where
    return Lead(
        f"Which solvers differ wherever the mesh lies, in {where}?", [first, f"{second}."], panels,
        f"A point is one scene on one mesh: error over error of {solver_title(measure)} on that "
        "mesh; left of 1 is better. Dot and line are the median and the range of 90 % of the "
        "points. Solvers differ where that range excludes 1.",
    )  # fmt: skip


def _ratio(pair: Mapping[str, Any]) -> str:
    """Write a ratio with its range; ends beside 1 are not written as 1 if the range excludes it."""

    def end(value: float) -> str:
        texts = [f"{value:.{digits}g}" for digits in range(3, 9 if pair["differs"] else 4)]
        return next((text for text in texts if text != "1"), texts[0])

    return f"{pair['ratio']:.3g} ({end(pair['low'])} to {end(pair['high'])})"

"""The page of the thesis study: whose claims hold, and its figures with ours beside them."""

from collections.abc import Mapping, Sequence
from typing import Any

from verify.report.notation import Drawing, Lead
from verify.report.plots import profile_panel


def thesis_view(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of the thesis with ours beside them."""
    face, steps, delays = record["face"], record["steps"], record["delays"]
    cuts = [0.0, *(float(row["asked"]) for row in face)]
    added = {
        "thesis, XFEM": ("thesis", "xfem"),
        "thesis, S + S": ("thesis", "snapping_subdivision"),
        "XFEM": ("added", "xfem"),
        "S + S, 0.02": ("added", "snapping_subdivision 0.02"),
        "S + S, 0.2": ("added", "snapping_subdivision 0.2"),
    }
    nodes = [
        (name, [0.0, *(row[part][method] for row in face)])
        for name, (part, method) in added.items()
    ]
    asked = [float(cut) for cut in dict.fromkeys(row["asked_cuts"] for row in steps)]
    sizes = [float(size) for size in dict.fromkeys(row["tetrahedra"] for row in delays)]

    def grouped(rows: Any, by: str, key: str, factor: float = 1.0) -> list[Any]:
        return [
            (f"{name} tets" if isinstance(name, int) else name,
             [factor * row[key] for row in rows if row[by] == name])
            for name in dict.fromkeys(row[by] for row in rows)
        ]  # fmt: skip

    def over_cuts(title: str, key: str, factor: float = 1.0) -> Drawing:
        curves = grouped(steps, "asked_tetrahedra", key, factor)
        return profile_panel(title, asked, curves, x_title="cuts")

    def over_sizes(title: str, key: str) -> Drawing:
        return profile_panel(title, sizes, grouped(delays, "speed_name", key), x_title="tetrahedra")

    unknowns = [profile_panel("nodes added", cuts, nodes, x_title="cut elements")]
    caption = "Nodes added by cuts that grow; S + S is snapping and subdivision with its threshold."
    return {
        "lead": Lead(
            "Which claims of the thesis hold?", _said(record["findings"]), unknowns, caption
        ),
        "times": [
            over_cuts("thesis: s per simulated s", "thesis_per_second"),
            over_cuts("here: ms per simulated s", "per_second", 1e3),
            over_cuts("here: nodes", "nodes"),
            over_cuts("thesis: nodes", "thesis_nodes"),
        ],
        "delays": [
            over_sizes("thesis: delay, s", "thesis"),
            over_sizes("size over speed: delay, s", "delay"),
        ],
    }


def _said(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say whose claims hold and whose fail, each by what it demands."""
    said = []
    for whose, words in (
        ("the thesis", "claims of the thesis"),
        ("this project", "claims of this project"),
    ):
        own = [finding for finding in findings if finding.get("whose") == whose]
        if not own:
            continue
        held = sum(finding["verdict"] == "PASS" for finding in own)
        text = f"Of {len(own)} {words}, {held} hold."
        for verdict, lead in (("FAIL", "Not"), ("UNDECIDED", "Not told by this run")):
            open_ones = [
                f"{finding['topic']} ({finding['expected']})"
                for finding in own
                if finding["verdict"] == verdict
            ]
            if open_ones:
                text += f" {lead}: {'; '.join(open_ones)}."
        said.append(text)
    return said or ["No claim was judged."]

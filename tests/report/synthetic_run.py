"""A run directory as a run leaves it, made without any solve.

The numbers follow c·h^p with a ripple, so that figures, tables and exports have something to
show; nothing here is a claim about a solver.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from verify.result import (
    CaseResult,
    Metric,
    Rate,
    ReferenceRecord,
    Regularisation,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    error_picture,
    write_result,
)
from verify.solution import Solution, write_solution

HOSTILE = "<script>alert('x')</script> & \"quotes\" \u202e\x00 url(http://evil.example) €"

PROVENANCE = {
    "commit": "0123456789abcdef0123456789abcdef01234567",
    "dirty": True,
    "versions": {"verify": "0.1.0", "python": "3.12.3", "numpy": "2.1.0", "dolfinx": "0.11.0"},
    "cpu": "An x86-64 CPU at 3.0 GHz",
    "cores": 2,
    "memory": 8 * 2**30,
    "threads": 1,
    "os": "Linux",
    "date": "2026-01-02T03:04:05+00:00",
}


def cut_square(n: int, order: int = 1, opening: float = 0.01, slender: bool = False) -> Solution:
    """Return a body of n × n (n even) squares with doubled nodes on an inclined cut, opened.

    `slender` makes it a strip, 20 mm by 100 mm, cut from its left side to its middle.
    """
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="xy")
    points = np.column_stack([s.ravel(), t.ravel()])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + 1, corner + n + 2, corner + n + 1
    cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    middle = (n // 2) * (n + 1) + np.arange(n + 1 if not slender else n // 2)
    twin = np.arange(len(points))
    twin[middle] = len(points) + np.arange(len(middle))
    above = points[cells, 1].mean(axis=1) > 0.5
    cells = np.where(above[:, None], twin[cells], cells)
    points = np.vstack([points, points[middle]])
    upper = np.zeros(len(points), dtype=bool)
    upper[np.unique(cells[above])] = True
    x, y = points.T
    share = np.clip(1 - 2 * x, 0, None) ** 0.5 if slender else 1 + 0.5 * x
    lift = opening * np.where(upper, 1, -1) * share * np.exp(-4 * np.abs(y - 0.5))
    if slender:
        points = points * [0.02, 0.1]
        displacement = np.column_stack([0.02 * lift, 0.1 * lift - 0.01 * (1 - y**2)])
    else:
        points = np.column_stack([x, y + (x - 0.5) / 3 * (1 - np.abs(2 * y - 1))])
        displacement = np.column_stack([0.3 * lift * np.sin(3 * x), lift])
    if order == 2:
        points, displacement, cells = _quadratic(points, displacement, cells)
    return Solution(points=points, cells=cells, displacement=displacement[None], order=order)


def write_error_field(solution: Solution, path: Path, values: np.ndarray | None = None) -> None:
    """Write an error field on the mesh of `solution`, as a run does."""
    import meshio

    points = np.column_stack([solution.points, np.zeros(len(solution.points))])
    if values is None:
        values = 1e-4 * np.exp(
            -30 * ((points[:, :2] - points[:, :2].mean(axis=0)) ** 2).sum(axis=1)
        )
    mesh = meshio.Mesh(points, [("triangle", solution.cells)], point_data={"error": values})
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.write(path, file_format="vtu")


def make_run(root: Path, pictures: bool = True, only: str = "") -> Path:
    """Write a run of three cases: exact and good, failing and ended, undecided; or `only` one."""
    cases = [one for one in (_airy(), _griffith(), _strip()) if only in one.case]
    root.mkdir(parents=True, exist_ok=True)
    record = {
        "schema": 1,
        "command": "verify run --out report",
        "started": "2026-01-02T03:04:05+00:00",
        "finished": "2026-01-02T03:06:07+00:00",
        "cases": [case.case for case in cases],
        "options": {"quick": True, "jobs": 1, "timeout": 60.0},
        "provenance": PROVENANCE,
    }
    (root / "run.json").write_text(json.dumps(record), encoding="utf-8")
    for case in cases:
        folder = root / "cases" / case.case.replace("/", "__")
        drawn = {
            error_picture(solver): f"cases/{folder.name}/error_field_{solver}.vtu"
            for solver in ("xfem", "conforming")
        }
        write_result(replace(case, pictures=drawn if pictures else {}), folder / "result.json")
        if pictures:
            slender = case.case.endswith("strip")
            for solver, n, order in (("xfem", 24, 1), ("conforming", 24, 1), ("reference", 16, 2)):
                if any(s.solver == solver for s in case.solves):
                    solution = cut_square(n, order, 0.03, slender)
                    for level in (2, 3):
                        write_solution(solution, folder / f"{solver}-{level}" / "solution")
            for solver in ("xfem", "conforming"):
                body = cut_square(24, slender=slender)
                write_error_field(body, folder / f"error_field_{solver}.vtu")
    return root


def _airy() -> CaseResult:
    case = "statics/f3_inclined"
    solves = [
        _solve(case, solver, level, 1.0, {"displacement_l2": (c, 2.0), "energy_norm": (9 * c, 1.0)})
        for solver, c in (("xfem", 3.0), ("conforming", 2.9))
        for level in range(4)
    ]
    rates = [
        Rate(solver, metric, order, 0.01, "", [order - 0.03, order - 0.01, order])
        for solver in ("xfem", "conforming")
        for metric, order in (("displacement_l2", 1.99), ("energy_norm", 0.99))
    ]
    verdicts = [
        _verdict("rate", "displacement_l2", "PASS", 1.99, 0.01, "at least 1.95", "1.99 ± 0.01"),
        _verdict("rate", "energy_norm", "PASS", 0.99, 0.005, "at least 0.98", "0.99 ± 0.005"),
        _verdict("ratio", "energy_norm", "PASS", 1.03, 0.0, "within 0.05 of 1", "on level 0"),
    ]
    acceptance = [
        {"check": "rate", "metric": "displacement_l2", "at_least": 1.95},
        {"check": "rate", "metric": "energy_norm", "at_least": 0.98},
    ]
    title = "F3: smooth field on each side of an inclined cut"
    requirement = "The XFEM shall converge as the conforming mesh does."
    reference = {"kind": "exact", "source": "exact: airy"}
    return _case(case, title, requirement, reference, solves, rates, verdicts, acceptance)


def _griffith() -> CaseResult:
    case = "statics/griffith_inside"
    orders = {"displacement_l2": (0.6, 1.0), "energy_norm": (1.1, 0.5), "strain_energy": (0.5, 1.0)}
    solves = [
        _solve(case, solver, level, c, orders, 8.07875793695)
        for solver, c in (("xfem", 1.4), ("conforming", 1.0))
        for level in range(4)
        if (solver, level) != ("xfem", 3)
    ]
    solves.append(SolveRecord(case, "xfem", 3, Status.TIMEOUT, "killed after 60 s", wall=60.2))
    refusal = "cannot do a tip inside an element"
    solves.append(SolveRecord(case, "other", 0, Status.REFUSED, refusal))
    rates = [
        Rate("xfem", "displacement_l2", None, 0.0, "oscillating: 1.4, 0.2", [1.4, 0.2]),
        Rate("conforming", "displacement_l2", 1.01, 0.03, "", [0.98, 1.0, 1.01]),
    ]
    verdicts = [
        _verdict("rate", "energy_norm", "FAIL", 0.38, 0.02, "0.5 ± 0.05", "0.38 is below 0.45"),
        _verdict("error", "displacement_l2", "ERROR", None, 0, "at most 0.1", "level 3 timed out"),
    ]
    acceptance = [{"check": "rate", "metric": "energy_norm", "equals": 0.5, "within": 0.05}]
    requirement = "The XFEM error shall stay below three times that of the conforming mesh."
    reference = {"kind": "exact", "source": "exact: griffith"}
    return _case(case, "Griffith crack in a box, tips inside elements", requirement, reference,
                 solves, rates, verdicts, acceptance)  # fmt: skip


def _strip() -> CaseResult:
    case = "statics/tissue_strip"
    source = "conforming P2, 3 levels, GCI"
    orders = {"energy_norm": (0.7, 0.6), "opening": (0.2, 1.0)}
    solves = [
        _solve(case, solver, level, c, orders, 2.31e-3, floor=0.03, source=source)
        for solver, c in (("xfem", 1.2), ("conforming", 1.0))
        for level in range(4)
    ]
    stored = "cases/statics__tissue_strip/reference-2/solution.json"
    solves.append(SolveRecord(case, "reference", 2, Status.SOLVED, size=5e-4, unknowns=81234,
                              wall=7.0, solution=stored))  # fmt: skip
    reason = "the reference's uncertainty 0.03 is not clearly below the error 0.12 that it judges"
    verdicts = [_verdict("error", "energy_norm", "UNDECIDED", 0.12, 0.03, "at most 0.1", reason)]
    sizes = ((2e-3, 5312), (1e-3, 20800), (5e-4, 81234))
    reference = {
        "kind": "conforming",
        "source": source,
        "levels": [{"h": h, "unknowns": n} for h, n in sizes],
        "metrics": {
            "strain_energy": _extrapolated([2.25e-3, 2.29e-3, 2.304e-3], 2.311e-3, 9e-6, 1.6),
            "opening": _extrapolated([1.1e-3, 1.14e-3, 1.15e-3], 1.153e-3, 4e-6, 2.0),
        },
    }
    title = "Soft-tissue strip cut halfway, hanging under its own weight"
    requirement = "The opening shall agree with a conforming mesh within its uncertainty."
    rate = Rate("xfem", "energy_norm", None, 0.0, "floor: 0.12 against 0.03", [0.6, 0.4, 0.2])
    return _case(case, title, requirement, reference, solves, [rate], verdicts, [])


def _case(case, title, requirement, reference, solves, rates, verdicts, acceptance) -> CaseResult:
    scene = {"title": title, "acceptance": acceptance}
    return CaseResult(case, title, requirement, "0" * 64, scene, ReferenceRecord(**reference),
                      solves, rates, verdicts, provenance=PROVENANCE)  # fmt: skip


def _extrapolated(values, value, uncertainty, order):
    return {"values": values, "extrapolated": value, "uncertainty": uncertainty, "order": order,
            "reason": ""}  # fmt: skip


def _solve(
    case, solver, level, factor, orders, reference=1.0, floor=0.0, source="exact: closed form"
):
    h = 0.125 * 0.5**level
    metrics = []
    for name, (c, p) in orders.items():
        error = factor * c * h**p * (1 + 0.05 * (-1) ** level)
        if name in ("strain_energy", "opening"):
            unit = "J/m" if name == "strain_energy" else "m"
            value, width = reference * (1 - error), reference * floor / 10
            metrics.append(Metric(name, value, unit, reference, width, source))
        else:
            metrics.append(Metric(name, error, "1", None, floor, source))
    n = (8 * 2**level + 1) ** 2 * 2
    phases = {"assembly": 2e-7 * n, "factorisation": 8e-8 * n**1.25, "solve": 1e-7 * n}
    if solver == "conforming":
        phases["meshing"] = 2e-5 * n
    timings = {name: [t * r for r in (1.0, 1.04, 1.3)] for name, t in phases.items()}
    dropped = Regularisation("zero-volume piece dropped", 2, 1e-13, "volume fraction")
    place = f"cases/{case.replace('/', '__')}/{solver}-{level}/solution.json"
    return SolveRecord(
        case, solver, level, Status.SOLVED, size=h, unknowns=n, metrics=metrics, timings=timings,
        peak_memory=2.1e8, wall=1.9, solution=place,
        regularisations=[dropped] if solver == "xfem" and level == 2 else [],
    )  # fmt: skip


def _verdict(check, metric, verdict, observed, width, limit, reason) -> VerdictRecord:
    low = None if observed is None else observed - width
    high = None if observed is None else observed + width
    return VerdictRecord(
        check, "xfem", metric, Verdict(verdict), observed, low, high, limit, reason
    )


def _quadratic(points, displacement, cells):
    """Return the P2 form of a P1 field, mid-points on straight edges."""
    pairs = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    edges, inverse = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    middle = len(points) + inverse.reshape(3, -1).T
    points = np.vstack([points, points[edges].mean(axis=1)])
    displacement = np.vstack([displacement, displacement[edges].mean(axis=1)])
    return points, displacement, np.column_stack([cells, middle])

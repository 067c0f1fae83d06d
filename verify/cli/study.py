"""Measure what slivers do, what accuracy costs, where an error comes from, and more.

Examples
--------
  verify study slivers --quick --out studies
  verify study slivers --solver xfem --solver 'xfem slivers=merge' --out studies
  verify study energy --solver my_module:MySolver --out studies
  verify study thesis --quick --out studies
  verify study calibration --quick --out studies
  verify study cost statics/tissue_strip --steps 4 --solver xfem --solver conforming --out studies
  verify study budget statics/tissue_strip --tolerance 0.05 --out studies

Writes NAME.json, NAME.csv and NAME.html into the directory. Exit code 0 whatever the
findings say: they compare methods, most of which are known to fail somewhere.
"""

from argparse import Namespace
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from verify.cli.signatures import Actions, Arg, Case, Out, Repetitions, count, positive, seed

_SOLVER = "'NAME [PARAMETER=VALUE …]'"
Quick = Annotated[bool, Arg("less of it, in under a minute")]
AsJson = Annotated[bool, Arg("print the findings as JSON", flags=("--json",))]
Variants = Annotated[
    Sequence[str],
    Arg(
        "solver, with parameters of its solves; repeat for several (default: xfem and conforming)",
        _SOLVER,
        ("--solver",),
    ),
]
Jobs = Annotated[
    int | None,
    Arg(
        "processes side by side (default: all cores; nothing measured is a time)",
        "N",
        ("-j", "--jobs"),
        count,
    ),
]
Tolerance = Annotated[float, Arg("relative error that is good enough", "T", read=positive)]


def slivers(
    cases: Annotated[
        Sequence[str], Arg("names, patterns or files; none: cases/slivers", "CASE")
    ] = (),
    *,
    solvers: Variants = (),
    processes: Jobs = None,
    quick: Quick = False,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """Errors, conditioning and explicit steps of any solver, over families of scenes."""
    return _study("slivers", **locals())


def energy(
    cases: Annotated[
        Sequence[str], Arg("names, patterns or files; none: those tagged energy", "CASE")
    ] = (),
    *,
    solvers: Variants = (),
    processes: Jobs = None,
    quick: Quick = False,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """What any solver keeps of energy and momenta, over cases that move."""
    return _study("energy", **locals())


def thesis(*, quick: Quick = False, out: Out, as_json: AsJson = False) -> int:
    """The tables and figures of the thesis measured again, its claims judged."""
    return _study("thesis", **locals())


def calibration(
    *,
    seed: Annotated[int, Arg("of the scenes", "N", read=seed)] = 30,
    quick: Quick = False,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """Stated uncertainty of the reference against its true error."""
    return _study("calibration", **locals())


def cost(
    case: Case,
    *,
    steps: Annotated[int, Arg("steps of the cut", "N", read=count)] = 4,
    solvers: Annotated[
        Sequence[str],
        Arg(
            "solver to compare; repeat for several (default: xfem and conforming, which "
            "remeshes at every step)",
            "NAME",
            ("--solver",),
        ),
    ] = (),
    metric: Annotated[
        Literal["displacement_l2", "energy_norm", "jump_l2"], Arg("the error that is held equal")
    ] = "energy_norm",
    repetitions: Repetitions = 5,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """Work against precision while the first cut of a case grows, at equal accuracy."""
    return _study("cost", **locals())


def budget(
    case: Case,
    *,
    level: Annotated[
        int | None, Arg("mesh level that is taken apart (default: finest)", "K")
    ] = None,
    tolerance: Tolerance = 0.05,
    metric: Annotated[
        str | None,
        Arg(
            "displacement_l2, energy_norm (in motion their means, displacement_l2_mean, "
            "energy_norm_mean) or a quantity of the case (default: the first of these)"
        ),
    ] = None,
    repetitions: Annotated[
        int | None,
        Arg("timed repetitions of each solve (default: 5; with --quick 2)", "N", read=count),
    ] = None,
    quick: Annotated[bool, Arg("the two coarsest mesh levels, fewer models")] = False,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """Where the error of the XFEM answer comes from, and the cheapest adequate model."""
    return _study("budget", **locals())


def iterations(
    case: Case,
    *,
    solver: Annotated[str, Arg("solver, with parameters of its solves", _SOLVER)] = "vbd",
    truth: Annotated[
        str | None,
        Arg("who solves the same steps (default: the solver with step=solved)", _SOLVER),
    ] = None,
    iterations: Annotated[
        Sequence[int], Arg("values of the parameter 'iterations'", "N", read=count, nargs="+")
    ] = (10, 40, 160),
    substeps: Annotated[
        Sequence[int], Arg("values of the parameter 'substeps'", "N", read=count, nargs="+")
    ] = (1, 4),
    most: Annotated[
        int | None,
        Arg(
            "leave out settings with more iterations than this in a step of the case",
            "N",
            read=count,
        ),
    ] = None,
    names: Annotated[Sequence[str], Arg("what the solver calls them", "PARAMETER", nargs=2)] = (
        "iterations",
        "substeps",
    ),
    tolerance: Tolerance = 0.01,
    out: Out,
    as_json: AsJson = False,
) -> int:
    """A solver of motion that stops by a count: its error, energy and cost."""
    return _study("iterations", **locals())


def _study(kind: str, **asked: Any) -> int:
    from verify.cli.study_command import execute

    return execute(Namespace(study=kind, **asked))


ACTIONS = Actions((slivers, energy, thesis, calibration, cost, budget, iterations), metavar="STUDY")

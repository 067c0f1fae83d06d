"""Exact solutions by name."""

from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from reference.exact.circular_cuts import ArcCrack, CircularCut, Penny
from reference.exact.moving_cracks import BladeStrip, Impact, ReleasedBar
from reference.exact.smooth_fields import (
    Airy,
    Bending,
    Layers,
    Linear,
    Patch,
    RolledHalves,
    Sinusoidal,
)
from reference.exact.solution import ExactSolution, Hooke, Parameters, hooke
from reference.exact.straight_cracks import (
    ClosedCrack,
    CrackTip,
    Griffith,
    PartlyClosedCrack,
    StraightFrontField,
)
from verify.errors import InputError
from verify.scene import Material, Scene
from verify.scene.strict import nearest

_CATALOGUE: dict[str, tuple[Callable[[Hooke, Parameters], ExactSolution], str]] = {
    "linear": (Linear, "uniform strain, uncut: matrix, shift"),
    "patch": (
        Patch,
        "uniform strain on each side of a straight cut, of each material.model: point, slope or "
        "angle, strain, shift",
    ),
    "bending": (
        Bending,
        "pure bending on each side of a straight cut: point, slope or angle, stress_gradient, "
        "shift",
    ),
    "rolled_halves": (
        RolledHalves,
        "finite rotation, of each material.model: each side of a straight cut bent away to a "
        "circle: point, slope or angle, thickness, curvature, shift",
    ),
    "airy": (
        Airy,
        "sin·cosh fields on each side of a straight cut: point, slope or angle, above and below "
        "(C, D, k each), shift",
    ),
    "smooth": (
        Sinusoidal,
        "sinusoids with a body force on each side of a straight cut: point, slope or angle, above "
        "and below (rows A, k, phase of U and V), shift",
    ),
    "tip": (CrackTip, "crack-tip field of modes I and II: tip, angle, intensity (K_I, K_II)"),
    "griffith": (
        Griffith,
        "crack in an infinite plate: centre, a, angle, remote stress (sxx, syy, sxy), pressure on "
        "its faces",
    ),
    "closed_crack": (
        ClosedCrack,
        "contact: crack whose faces press on each other in an infinite plate: centre, a, angle, "
        "remote stress (sxx, syy, sxy)",
    ),
    "partly_closed_crack": (
        PartlyClosedCrack,
        "contact: crack of half-length a in a remote field that grows along it by slope, closed "
        "beyond -a/3: centre, a, angle, slope",
    ),
    "arc_crack": (
        ArcCrack,
        "crack along an arc of a circle in an infinite plate: centre, radius, angle of its middle, "
        "half_angle, remote stress (sxx, syy, sxy)",
    ),
    "circular_cut": (
        CircularCut,
        "disc at rest, cut out of a body that is drawn outwards: centre, radius, outward, at",
    ),
    "solid_patch": (
        Patch,
        "3D: uniform strain on each side of a plane cut, of each material.model: point, normal, "
        "axis, strain and shift (rows above, below)",
    ),
    "solid_smooth": (
        Sinusoidal,
        "3D: plane waves with a body force on each side of a plane cut: point, normal, axis, above "
        "and below (rows A, k1, k2, phase of U1, U2, V), shift",
    ),
    "spherical_cut": (
        CircularCut,
        "3D: ball at rest, cut out of a body that is drawn outwards: centre, radius, outward, at",
    ),
    "penny": (
        Penny,
        "3D: penny-shaped crack in infinite space: centre, normal, a, remote tension or stress "
        "(three rows), pressure on its faces",
    ),
    "straight_front": (
        StraightFrontField,
        "3D: field of modes I, II and III at the straight front of a plane crack: point, normal, "
        "axis (the direction ahead), intensity (K_I, K_II, K_III); neo-Hookean too: III alone",
    ),
    "blade_strip": (
        BladeStrip,
        "3D, moving: mode III crack that advances through a strip gripped at ±grip: half_width, "
        "grip, speed, tip at the time 0, angle of its way in the x-y plane",
    ),
    "impact": (
        Impact,
        "contact, moving: halves of a bar that meet: half_length, at, axis (default x), speed of "
        "each, gap",
    ),
    "released_bar": (
        ReleasedBar,
        "moving: a strained bar between held ends, let go across at the time 0: strain, ends along "
        "x, at, origin",
    ),
}
_LAYERS = (
    "linear on each of four parts, two materials and a cut: point, slope or angle, interface_slope "
    "or interface_angle, stress, shift"
)
_IN_SPACE = (
    "linear", "solid_patch", "solid_smooth", "spherical_cut", "penny", "straight_front",
    "blade_strip", "impact", "released_bar",
)  # fmt: skip
_IN_BOTH = ("linear", "impact", "released_bar")
_AT_ANY_STRAIN = ("patch", "rolled_halves", "solid_patch", "straight_front")
_GROUP = "verify.exact_solutions"  # entry points of other packages


def exact_of(scene: Scene) -> Any:
    """Return the exact solution that a scene names, or None."""
    if scene.exact is None:
        return None
    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def exact_solution_names() -> dict[str, str]:
    """Find names of the exact solutions, each with one line on what it is and its parameters."""
    own = {name: text for name, (_, text) in _CATALOGUE.items()} | {"layers": _LAYERS}
    return {name: f"from {point.value}" for name, point in _registered().items()} | own


def _registered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=_GROUP)}


def exact_solution(name: str, parameters: Mapping[str, Any], material: Material) -> ExactSolution:
    """Make the exact solution called `name`.

    Parameters
    ----------
    name : str
        One of `exact_solution_names`: of this package, or an entry point
        ``verify.exact_solutions`` of another.
    parameters : mapping
        Its parameters in SI units, as in the section ``[exact]`` of a case file.
    material : Material

    Raises
    ------
    InputError
        If the name or a parameter is unknown, missing or has the wrong form, or the code of
        another package fails.
    """
    given = Parameters(name, parameters)
    solution = _made(name, given, material)
    given.close()
    return solution


def _made(name: str, given: Parameters, material: Material) -> ExactSolution:
    law = hooke(material)
    if name == "layers" and law.dimension == 2:
        return Layers(material, given)
    if not material.is_uniform:
        raise InputError(f"exact solution '{name}' is of one material; there are material.regions")
    if name not in _CATALOGUE:
        return _from_entry_point(name, law, given)
    if material.model != "hooke" and name not in _AT_ANY_STRAIN:
        raise InputError(
            f"exact solution '{name}' is of Hooke's law; material.model = '{material.model}' "
            f"knows {', '.join(_AT_ANY_STRAIN)}"
        )
    if law.dimension == 3 and name not in _IN_SPACE:
        raise InputError(
            f"exact solution '{name}' is plane; material.plane = 'strain' or 'stress' is missing"
        )
    if law.dimension == 2 and name in _IN_SPACE and name not in _IN_BOTH:
        raise InputError(f"exact solution '{name}' is one of space; this scene is plane")
    return _CATALOGUE[name][0](law, given)


def _from_entry_point(name: str, law: Hooke, given: Parameters) -> ExactSolution:
    """Make a solution that another package registers; its class takes the law and parameters."""
    points = _registered()
    if name not in points:
        raise InputError(f"no exact solution '{name}'{nearest(name, exact_solution_names())}")
    try:
        solution: ExactSolution = points[name].load()(law, given)
    except InputError:
        raise
    except Exception as error:  # somebody else's code: whatever it does is one clear line
        raise InputError(
            f"exact solution '{name}' ({points[name].value}) cannot be made: "
            f"{type(error).__name__}: {error}"
        ) from error
    if not isinstance(solution, ExactSolution):
        raise InputError(
            f"exact solution '{name}' ({points[name].value}) makes a {type(solution).__name__}; "
            "expected an instance of reference.exact.ExactSolution"
        )
    return solution

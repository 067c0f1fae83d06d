"""The blade of a tool path: the energy that it releases, and K_III where it is.

A tip that moves takes the energy release rate G out of the continuum per unit advance. A mesh has
no such sink: what the time scheme and the damping do not take is left as waves of the length of
an element. With an exact field they are the difference from it; without one, motions of periods
below 4h/c, c the speed of shear waves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, body_of
from verify.compare.cut_profile import cut_place
from verify.compare.cut_rule import CutRule, cut_rule_of
from verify.compare.errors import displacement_jump
from verify.compare.hooke import Law, difference_energy, short_wave_energy
from verify.compare.locate import Field
from verify.compare.mass import density_of
from verify.compare.motion import Motion, field_at
from verify.compare.motion_account import MotionAccount, total_energy
from verify.compare.simplex_bodies import SolidBody
from verify.errors import InputError, UnsupportedSceneError
from verify.result import Metric
from verify.scene import Material, Scene, ToolPathCut
from verify.scene.acceptance import StressIntensityQuantity
from verify.solution import Solution

Array = NDArray[np.float64]

_UNIT = "J/m²"
_PERIODS = 4.0  # shortest waves last up to that many h/c


def released_metrics(
    scene: Scene, solution: Solution, size: float, law: Law, account: MotionAccount, exact: Any
) -> tuple[list[Metric], dict[str, str]]:
    """Measure where the energy went that the blades of a scene release, J per m² of their way.

    ``released``: G, if the exact solution states it. ``released_to_cut``: work of the tie forces
    that the solver states. ``_scheme``: the rest of the measured balance of energies, as uncertain
    as the balance. ``_damping``: the energy that damping takes by its rate. ``_kinetic`` and
    ``_strain``: energy of the difference from the exact field since the start. Its kinetic energy
    takes the solver's own mass: a lumped mass holds more of short waves than the field.
    ``_short_waves``: without an exact field, kinetic energy of motions of periods below 4h/c.
    ``released_mismatch``: the share of G by which cut, scheme, damping and difference miss it.

    Parameters
    ----------
    scene : Scene
    solution : Solution
    size : float
        Element size h, m.
    law : Law
    account : MotionAccount
        Of the solution.
    exact : object or None
        The exact solution, if it judges.

    Returns
    -------
    metrics : list of Metric
    notes : dict of str to str
        For what could not be measured, why. Both are empty if no blade advances.
    """
    area = advance(scene)
    if area == 0.0:
        return [], {}
    values, notes = _dissipated(account)
    if exact is None:
        found, why = _short_waves(scene, solution, size)
    else:
        found, why = _difference(scene, solution, law, exact)
        if found:
            found["released_to_kinetic"] += _in_the_mass(account)
    values, notes = values | found, notes | why
    values = {name: value / area for name, value in values.items()}
    width = account.energies.width[[0, -1]].sum() if account.energies.parts else 0.0
    off = {"released_to_scheme": float(width / area)}
    metrics = [
        Metric(name, value, _UNIT, None, off.get(name, 0.0), "fields of the solution")
        for name, value in values.items()
    ]
    rate = getattr(exact, "energy_release_rate", None)
    if rate is not None:
        metrics.append(Metric("released", float(rate), _UNIT, source="exact solution"))
        missing = sorted({"released_to_scheme", "released_to_kinetic"} - values.keys())
        if missing:
            notes["released_mismatch"] = notes[missing[0]]
        else:
            missed = abs(sum(values.values()) - rate) / rate
            metrics.append(Metric("released_mismatch", missed, "1", source="exact solution"))
    return metrics, notes


def blade_forces(scene: Scene, account: MotionAccount) -> dict[str, list[float]]:
    """Return the forces on blades over the output times, in newtons (in the plane N/m).

    ``driving_force_`` and the name of the cut: energy that the tie forces of the cut take per
    advance of the blade; positive pulls the blade on. Where the cut has a toughness R,
    ``resistance_`` and the name: R times the width that is cut, less the driving force. Both are
    smoothed over two intervals between outputs, and NaN while the blade rests. Without an entry
    ``cut_work_`` and the name of the cut in the ledger, a single blade has the whole ``cut_work``.
    Empty if no blade has any.
    """
    paths = [cut for cut in scene.cuts if isinstance(cut, ToolPathCut)]
    times, found = account.times, {}
    for cut in paths:
        work = account.stated.get(f"cut_work_{cut.name}")
        if work is None and len(paths) == 1:
            work = account.stated.get("cut_work")
        if work is None or len(times) < 2:
            continue
        way = travelled(cut, times)
        length = 2.0 * float(np.diff(way).max())
        found[f"driving_force_{cut.name}"] = driving_force(way, work, length).tolist()
        if cut.toughness is not None:
            steps = [swept_area(scene, [cut], *ends) for ends in pairwise(times.tolist())]
            area = np.concatenate([[0.0], np.cumsum(steps)])
            left = cut.toughness * (scene.material.thickness or 1.0) * area - work
            found[f"resistance_{cut.name}"] = driving_force(way, left, length).tolist()
    return found


def travelled(cut: ToolPathCut, times: Array) -> Array:
    """Measure the travel (n,) of a blade at some times, m, by the end that goes farther.

    The same as `verify.xfem.ToolPath.travel`.
    """
    return np.interp(times, cut.moments, cut.travel)


def driving_force(advance: Array, cut_work: Array, length: float) -> Array:
    """Compute the energy (n,) per advance of a blade, smoothed, in newtons.

    Parameters
    ----------
    advance : (n,) array
        How far the blade has come, m; it does not decrease.
    cut_work : (n,) array
        Energy that it has taken since the start, J.
    length : float
        Of the advance over which it is smoothed, half of it before and after, m; ends cut it off.

    Returns
    -------
    (n,) array
        NaN where the blade does not move. Energy that fading forces take while it rests counts at
        the place of rest: to the advance on either side within `length`.
    """
    goes = np.diff(advance) > 0.0
    moving = np.append(goes, False) | np.append(False, goes)
    found = np.full(len(advance), np.nan)
    last = np.append(goes, True)  # of instants at which the blade is in one place
    low, high = (
        np.clip(advance[moving] + end, advance[0], advance[-1])
        for end in (-0.5 * length, 0.5 * length)
    )
    before, after = (np.interp(x, advance[last], cut_work[last]) for x in (low, high))
    found[moving] = (after - before) / (high - low)
    return found


def advance(scene: Scene) -> float:
    """Compute area that the blades of a scene sweep in its body during the motion, m² (2D: m)."""
    duration = scene.analysis.duration
    paths = [cut for cut in scene.cuts if isinstance(cut, ToolPathCut)]
    return swept_area(scene, paths, 0.0, duration or 0.0)


def swept_area(scene: Scene, paths: Sequence[ToolPathCut], start: float, end: float) -> float:
    """Compute the area that blades sweep in the body of a scene between two times, m² (2D: m)."""
    parts = [part for cut in paths if (part := cut.between(start, end)) is not None]
    total = 0.0
    for part in parts:
        alone = scene.model_copy(update={"cuts": [part]})
        alone._file, alone._name = scene.file, scene.name
        try:
            body = body_of(alone)
        except UnsupportedSceneError:
            return 0.0
        if body.has_cuts:
            total += float(cut_rule_of(body, body.size / 20).weights.sum())
    return total


def _dissipated(account: MotionAccount) -> tuple[dict[str, float], dict[str, str]]:
    """Find what the scheme and the dampers took, J."""
    parts = account.energies.parts
    total = total_energy(parts)
    if total is None:
        names = ("released_to_scheme", "released_to_damping")
        return {}, dict.fromkeys(names, account.energies.lacking)
    values = {"released_to_scheme": float(total[0] - total[-1])}
    if "cut_work" in account.stated:
        taken = account.stated["cut_work"]
        values["released_to_cut"] = float(taken[-1] - taken[0])
        values["released_to_scheme"] -= values["released_to_cut"]
    if "damping" in parts:
        values["released_to_damping"] = float(parts["damping"][-1])
    return values, {}


def _difference(
    scene: Scene, solution: Solution, law: Law, exact: Any
) -> tuple[dict[str, float], dict[str, str]]:
    names = ("released_to_kinetic", "released_to_strain")
    if scene.analysis.kinematics != "linear" or scene.cell_dimension < scene.dimension:
        return {}, dict.fromkeys(names, "energies of differences add up in linear solids only")
    times, density = solution.times, density_of(scene, solution)
    try:
        first, last = (
            np.array(difference_energy(solution, k, field_at(exact, float(times[k])), law, density))
            for k in (0, len(times) - 1)
        )
    except InputError as problem:
        return {}, dict.fromkeys(names, str(problem))
    return dict(zip(names, (last - first).tolist(), strict=True)), {}


def _in_the_mass(account: MotionAccount) -> float:
    """Compute the kinetic energy of the solver's mass beyond its velocity field, J.

    It belongs to the difference from the exact field: for smooth fields any mass is consistent.
    """
    if not account.energies.parts or account.whole is None:
        return 0.0
    beyond = account.energies.parts["kinetic"] - account.whole.energy
    return float(beyond[-1] - beyond[0])


def _short_waves(
    scene: Scene, solution: Solution, size: float
) -> tuple[dict[str, float], dict[str, str]]:
    material, name = scene.material, "released_to_short_waves"
    if (stated := solution.quantities.get("short_wave_energy")) is not None:
        return {name: stated}, {}  # of every step, not only of outputs
    assert material.density is not None
    shear = material.young / (2 * (1 + material.poisson))
    period = _PERIODS * size / float(np.sqrt(shear / material.density))
    try:
        return {name: short_wave_energy(solution, period, density_of(scene, solution))}, {}
    except InputError as problem:
        return {}, {name: str(problem)}


_NEAREST, _PLACES = 0.25, 12  # first place over the radius, number of places


@dataclass(frozen=True)
class BladeFront:
    """A straight front in space at an instant.

    Parameters
    ----------
    point : (3,) array
        In the middle of its part in the body, m.
    ahead : (3,) array
        Unit vector of its advance.
    blade : (3,) array
        Unit vector along it; ahead × blade points to the positive side of the cut.
    speed : float
        m/s.
    """

    point: Array
    ahead: Array
    blade: Array
    speed: float

    @property
    def along(self) -> Array:
        """Third axis: K_III is positive where the positive face slides along it."""
        return np.cross(self.ahead, np.cross(self.ahead, self.blade))


def tearing_intensity(
    field: Field, body: AnyBody, cut: str, front: BladeFront, radius: float, material: Material
) -> float:
    """Compute K_III in Pa √m by displacement correlation, extrapolated to the front.

    Near a front that advances at v the jump is (4 K/(μ g)) √(r/2π) (1 + k r), g² = 1 − ρv²/μ. Here
    r is the distance behind the front. K and k are fitted by least squares at places from a quarter
    of the radius to the radius, evenly spaced in √r.

    Parameters
    ----------
    field : Field
        At that time.
    body : Body or SolidBody
    cut : str
        Its name.
    front : BladeFront
    radius : float
        m; within it the cut is plane and open, and nothing else disturbs the field.
    material : Material
        With a density, if the front moves.
    """
    root = np.linspace(np.sqrt(_NEAREST * radius), np.sqrt(radius), _PLACES)
    places = [cut_place(body, cut, (front.point - r * front.ahead).tolist()) for r in root**2]
    rule = CutRule.joined(places, 3)
    jump = displacement_jump(field, rule) @ front.along
    columns = np.column_stack([root, root**3])
    first = np.linalg.lstsq(columns, jump, rcond=None)[0][0]
    shear = material.young / (2 * (1 + material.poisson))
    contraction = np.sqrt(1.0 - front.speed**2 * (material.density or 0.0) / shear)
    return float(first * shear * contraction * np.sqrt(2 * np.pi) / 4)


_SAMPLES = 401  # points of the blade, of which those in the body count


def blade_intensity(
    scene: Scene, motion: Motion, body: AnyBody, asked: StressIntensityQuantity
) -> float:
    """Compute K_III in Pa √m at the place where the blade is, wherever a solver has its tip.

    Raises
    ------
    UnsupportedSceneError
        If the blade does not advance through the body at that time, at finite rotation, or where
        materials differ by region.
    """
    if scene.analysis.kinematics != "linear" or not scene.material.is_uniform:
        raise UnsupportedSceneError(
            "K_III at a blade is measured in linear kinematics and one material"
        )
    cut = next(cut for cut in scene.cuts if cut.name == asked.cut)
    assert isinstance(cut, ToolPathCut)  # the scene was checked
    assert asked.radius is not None
    assert isinstance(body, SolidBody)
    time = scene.analysis.output_times[-1] if asked.time is None else asked.time
    front = blade_front(cut, body, float(time))
    field = motion.at(float(time))
    return tearing_intensity(field, body, asked.cut, front, asked.radius, scene.material)


def blade_front(cut: ToolPathCut, body: SolidBody, time: float) -> BladeFront:
    """Compute the front at a time, on the move that leads there.

    Raises
    ------
    UnsupportedSceneError
        If the blade is outside the body then, or does not advance.
    """
    tips, moments, blades = np.array(cut.points, dtype=float), cut.moments, cut.blade
    move = min(max(int(np.searchsorted(moments, time)), 1), len(moments) - 1)
    lasts, way = float(moments[move] - moments[move - 1]), tips[move] - tips[move - 1]
    share = (time - moments[move - 1]) / lasts if lasts > 0.0 else 2.0
    length = float(np.linalg.norm(way))
    if not 0.0 <= share <= 1.0 + 1e-9 or length == 0.0:
        raise UnsupportedSceneError(f"the blade of '{cut.name}' does not advance at {time:.6g} s")
    blade = blades[move - 1] + share * (blades[move] - blades[move - 1])
    tip = tips[move - 1] + share * way
    along = tip + np.linspace(0.0, 1.0, _SAMPLES)[:, None] * blade
    inside = body.inside(along)
    if not inside.any():
        raise UnsupportedSceneError(f"the blade of '{cut.name}' is outside at {time:.6g} s")
    blade = blade / np.linalg.norm(blade)
    across = way - (way @ blade) * blade  # a blade that slides along itself cuts nothing
    speed = float(np.linalg.norm(across)) / lasts
    return BladeFront(along[inside].mean(axis=0), across / np.linalg.norm(across), blade, speed)

"""Stress-intensity factors in motion that ring: time steps far below the time across an element."""

from collections.abc import Mapping

from reference.moduli import wave_speed
from verify.result import Notice, NoticeKind
from verify.scene import Scene
from verify.scene.acceptance import StressIntensityQuantity
from verify.solution import Solution

# Of h/c. Quadratic elements carry waves down to about 2h; those turn by π times this per step, and
# what turns by less than about 1 the time scheme no longer damps. They do not leave a graded mesh.
# A suddenly pressed crack, K off: 5e-4 at 0.3, 1e-3 at 0.22, 3e-2 at 0.11.
_SHORT = 0.25


def ringing_factors(scene: Scene, levels: Mapping[int, Solution]) -> list[Notice]:
    """Warn of the factors of a reference whose steps are far shorter than a wave takes across h.

    Parameters
    ----------
    scene : Scene
    levels : mapping of int to Solution
        Of a conforming reference: every level halves step and elements. Empty without one.
    """
    names = [one.name for one in scene.quantities if isinstance(one, StressIntensityQuantity)]
    duration = scene.analysis.duration
    if not names or not levels or duration is None:
        return []
    solution = levels[max(levels)]
    steps = solution.iterations.get("steps")
    if not steps:
        return []
    step, across = duration / steps, float(solution.size / wave_speed(scene.material))
    if step >= _SHORT * across:
        return []
    text = (
        f"the mean step of the reference, {step:.3g} s, is {step / across:.2g} of the time in "
        f"which a pressure wave crosses its elements, {across:.3g} s: short waves stay between "
        "elements of different sizes and ring in these factors. Fewer outputs, a longer time_step "
        "or a smaller reference.size help"
    )
    return [Notice(NoticeKind.WARNING, ", ".join(names), "reference", text)]

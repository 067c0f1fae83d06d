"""Linear systems of a scene and of the same body without its cuts."""

from collections.abc import Mapping
from typing import Any

from verify.scene import Scene
from verify.system import System, checked_system


def with_uncut_twin(
    system: Any, scene: Scene, level: int, parameters: Mapping[str, Any]
) -> tuple[System, System]:
    """Return the systems of a scene and of its uncut body, as the hook `system` of a solver gives.

    Raises
    ------
    UnsupportedSceneError, InputError
        If the solver refuses one of them, or hands over no system.
    """
    whole = scene.model_copy(update={"cuts": [], "quantities": [], "acceptance": []})
    own, uncut = (checked_system(system(one, level, **parameters)) for one in (scene, whole))
    return own, uncut

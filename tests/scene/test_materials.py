"""Materials by region: what a case may say, and which material is where."""

import numpy as np
import scenes

from verify.scene import crossed_by_interfaces, scene_hash


def scene(regions, **material):
    return scenes.scene(material=scenes.soft(regions=regions, **material))


def test_a_region_inherits_what_it_does_not_name_and_the_last_one_counts() -> None:
    one = scene(
        [{"where": "x > 0.5", "young": 2.0, "density": 30.0}, {"where": "y > 0.5", "poisson": 0.1}],
        density=10.0,
    )
    found = one.material.at(np.array([[0.2, 0.2], [0.7, 0.2], [0.7, 0.7]]))
    assert found.young.tolist() == [1.0, 2.0, 1.0]
    assert found.poisson.tolist() == [0.3, 0.3, 0.1]
    assert found.density.tolist() == [10.0, 30.0, 10.0]


def test_a_scene_of_one_material_keeps_its_hash() -> None:
    """Stored references stay valid: a key that is not given does not count."""
    whole = scenes.scene()
    assert scene_hash(scene([])) == scene_hash(whole) == scene_hash(scenes.scene(title="other"))
    assert scene_hash(scene([{"where": "x > 0.5", "young": 2.0}])) != scene_hash(whole)


def test_a_cell_is_crossed_unless_the_interface_runs_along_its_facets() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    cells = np.array([[0, 1, 3], [0, 3, 2]])
    along = scene([{"where": "y > x", "young": 2.0}]).material
    across = scene([{"where": "y > x + 0.1", "young": 2.0}]).material
    assert crossed_by_interfaces(along, points, cells).tolist() == [False, False]
    assert crossed_by_interfaces(across, points, cells).tolist() == [False, True]

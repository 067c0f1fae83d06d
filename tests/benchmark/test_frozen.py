"""Versions of the benchmark: a value changes with a new version and an entry that says so."""

import hashlib
import json
import re
import tomllib
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VALUES = tomllib.loads((ROOT / "cases/benchmark/values.toml").read_text("utf-8"))
PAGE = (ROOT / "docs/benchmark/index.md").read_text("utf-8")

# Digest of the values of each scene, by version. A new scene gets a line in the last version; a
# line that is there stays, also when a new version is begun.
FROZEN = {
    "1.0": {
        "c1_slit": "1903205a6b76ff93",
        "c2_meeting": "e2604ce04e9e6c07",
        "c4_disc": "63e0260eaa1aaa5c",
        "c8_slivers[epsilon=0.5]": "b73941cf325b8e1d",
        "c8_slivers[epsilon=0]": "8985e2890fd6aba2",
        "c8_slivers_space[epsilon=0.5]": "736287b738c0aab9",
        "c8_slivers_space[epsilon=0]": "899393247c611cf6",
        "c8_slivers_corner[epsilon=0.5]": "593505e9cef76b71",
        "c3_strip": "0a9165b4bd97d77c",
        "c5_blade_01": "8a602cdc74439e84",
        "c5_blade_03": "51dbf38021b944ef",
        "c5_blade_06": "244f66bbe562bd65",
        "c6_block": "6899b0a0b7412f12",
        "c7_spinning": "423b45aad475cfd9",
    },
    "1.1": {
        "c1_slit": "1903205a6b76ff93",
        "c2_meeting": "2b431200dc1c8e1b",
        "c4_disc": "63e0260eaa1aaa5c",
        "c8_slivers[epsilon=0.5]": "b73941cf325b8e1d",
        "c8_slivers[epsilon=0]": "8985e2890fd6aba2",
        "c8_slivers_space[epsilon=0.5]": "736287b738c0aab9",
        "c8_slivers_space[epsilon=0]": "899393247c611cf6",
        "c8_slivers_corner[epsilon=0.5]": "593505e9cef76b71",
        "c3_strip": "0a9165b4bd97d77c",
        "c5_blade_01": "8a602cdc74439e84",
        "c5_blade_03": "51dbf38021b944ef",
        "c5_blade_06": "244f66bbe562bd65",
        "c6_block": "f216e34c88548e9d",
        "c7_spinning": "309841d4862cfc9a",
    },
}
FROZEN["1.2"] = FROZEN["1.1"] | {
    "c5_blade_01": "479761e5b7789144",
    "c5_blade_03": "a12cf7889650e8b3",
    "c5_blade_06": "e9174c5d93525630",
}


def digest(table):
    return hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()[:16]


def complaints(values, frozen, page):
    """Say what of the values is not as it was frozen, or has changed without a word."""
    version, found = values["version"], []
    own = {name: digest(table) for name, table in values.items() if name != "version"}
    if version not in frozen:
        return [f"version {version} is not frozen: add {version!r}: {own}"]
    found += [
        f"{name}: its values are not those of version {version}; a new version with an entry in "
        f"docs/benchmark/index.md changes them (digest {mark})"
        for name, mark in own.items()
        if frozen[version].get(name) != mark
    ]
    found += [f"{name} is gone" for name in frozen[version].keys() - own.keys()]
    for before, after in pairwise(frozen):
        entry = re.search(rf"^.*\b{re.escape(after)}: (.*)$", page, re.MULTILINE)
        found += [
            f"{name} changed with version {after}, which its entry does not say"
            for name, mark in frozen[before].items()
            if frozen[after].get(name) != mark and (not entry or name not in entry[1])
        ]
    return found


def test_every_value_is_as_it_was_frozen_and_every_change_has_its_entry():
    assert complaints(VALUES, FROZEN, PAGE) == []


def test_a_value_that_changes_in_silence_is_found():
    one, other = {"strain_energy": ["1 ± 1e-6", "1 ± 1e-5"]}, {"strain_energy": ["2 ± 1e-6", "2"]}
    frozen = {"1.0": {"c1": digest(one)}}
    assert complaints({"version": "1.0", "c1": one}, frozen, "") == []
    assert "c1: its values are not" in complaints({"version": "1.0", "c1": other}, frozen, "")[0]
    assert "not frozen" in complaints({"version": "1.1", "c1": other}, frozen, "")[0]
    assert complaints({"version": "1.0"}, frozen, "") == ["c1 is gone"]
    frozen["1.1"] = {"c1": digest(other)}
    later = {"version": "1.1", "c1": other}
    assert "does not say" in complaints(later, frozen, "1.0: the first.\n1.1: c2.")[0]
    assert complaints(later, frozen, "1.0: the first.\n1.1: c1 was wrong.") == []

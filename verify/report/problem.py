"""The problem of a case in words: body, material, cuts, supports, loads, mesh."""

from collections.abc import Mapping
from typing import Any

# what says nothing where it is so
_USUAL: dict[str, Any] = {
    "opens_at": 0.0, "expected": None, "damping": [0.0, 0.0], "starts_at": 0.0, "name": "cut",
    "schema": 1,
}  # fmt: skip
_UNITS = {"young": "Pa", "density": "kg/m³", "speed": "m/s", "duration": "s", "time_step": "s",
          "acceleration": "m/s²", "opens_at": "s", "starts_at": "s", "thickness": "m",
          "lower": "m", "upper": "m", "radius": "m", "depth": "m", "traction": "Pa",
          "pressure": "Pa", "force": "N/m³"}  # fmt: skip
_NAMES = {"young": "E", "poisson": "ν", "where": "on", "cells": "elements"}
_SHOWN = 8  # entries of a list


def problem_facts(scene: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return what the scene of a result asks, as headings with lines."""
    facts: list[tuple[str, list[str]]] = []
    for key, title in (("geometry", "Body"), ("material", "Material"), ("analysis", "Kinematics"),
                       ("cuts", "Cuts"), ("supports", "Supports"), ("loads", "Loads"),
                       ("initial", "Initially"), ("exact", "Exact solution"),
                       ("mesh", "Mesh")):  # fmt: skip
        found = scene.get(key)
        lines = [_line(entry) for entry in (found if isinstance(found, list) else [found])]
        if lines := [line for line in lines if line]:
            more = len(lines) - _SHOWN
            facts.append((title, lines[:_SHOWN] + ([f"and {more} more"] if more > 0 else [])))
    return facts


def _line(entry: Any) -> str:
    if not isinstance(entry, Mapping):
        return "" if entry in (None, [], {}) else _words(entry)
    said = [_words(entry[key]) for key in ("kind", "solution") if entry.get(key)]
    for key, value in entry.items():
        usual = key in _USUAL and value == _USUAL[key]
        if key in ("kind", "solution") or value in (None, [], {}, "") or usual:
            continue
        unit = f" {_UNITS[key]}" if key in _UNITS and not isinstance(value, str) else ""
        said.append(f"{_NAMES.get(str(key), str(key)).replace('_', ' ')} {_words(value)}{unit}")
    return ", ".join(said)


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"({_line(value)})"
    if isinstance(value, list | tuple):
        shown = [_words(entry) for entry in value[:_SHOWN]]
        rest = [f"… {len(value)} in all"] if len(value) > _SHOWN else []
        return f"({', '.join(shown + rest)})"
    if isinstance(value, float):
        return f"{value:.5g}".replace("-", "−")
    return str(value)

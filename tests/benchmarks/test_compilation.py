"""Cost of the first use of kernels, in a process of its own with an empty cache.

Seconds say nothing on a machine that does other things too: the unit is a small kernel, compiled
in the same process before and after.
"""

import json
import os
import subprocess
import sys

import pytest

pytestmark = [pytest.mark.heavy, pytest.mark.timing]

_MEASURE = """
import gc, json, statistics, sys
from dataclasses import asdict
from time import process_time
import numba, numpy
from verify.first_use import STAGES, compile_here

def product(A, B, C):
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += A[i, k] * B[k, j]
            C[i, j] += total

def unit():
    A, kernel = numpy.eye(3), numba.njit(product)
    start = process_time()
    kernel(A, A, A)
    return process_time() - start

gc.disable()
unit()  # the compiler's own start
units = [unit() for _ in range(5)]
found = asdict(compile_here(sys.argv[1:] or list(STAGES)))
units += [unit() for _ in range(5)]
print(json.dumps(found | {"unit": statistics.median(units)}))
"""


def measure(cache, *stages):
    done = subprocess.run(
        [sys.executable, "-c", _MEASURE, *stages],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def in_units(found):
    whole = sum(found["seconds"].values())
    print(f"\n{found['kernels']} compilations, {whole:.1f} s, unit {found['unit']:.3f} s")
    for name, seconds in found["seconds"].items():
        if seconds > 0.01 * whole:
            print(f"{seconds:6.2f}  {name}")
    return whole / found["unit"]


# 8 s on a core that takes 0.1 s for the unit; the scalpel: all that it needs alone; everything: the
# goal is 30 s on that core, 300 units, and 314 to 348 were measured, more the busier the machine is
@pytest.mark.parametrize(
    ("stages", "most"), [(["plane: statics"], 80.0), (["space: scalpel"], 250.0), ([], 400.0)]
)
def test_first_use_of_a_kind_of_scene_compiles_for_a_bounded_number_of_small_kernels(
    stages, most, tmp_path
):
    assert in_units(measure(tmp_path, *stages)) < most


def test_kernels_compile_once_and_are_found_in_the_cache_after_that(tmp_path):
    stages = ["plane: statics", "plane: rotation and motion", "comparison"]
    first, second = measure(tmp_path, *stages), measure(tmp_path, *stages)
    in_units(first)
    assert first["kernels"] > 30
    assert second["kernels"] == 0
    # a tenth of the goal for everything (300 units): such a kernel is one to divide or rewrite
    assert max(first["seconds"].values()) < 30.0 * first["unit"]

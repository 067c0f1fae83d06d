"""Kernels and their parts: the same numbers as numba's own decorator, and less made."""

import numba
import numpy as np
import pytest

from verify import compiled
from verify.compiled import decorators

pytestmark = pytest.mark.skipif(not decorators._TRIED, reason="another numba: its own decorator")


@pytest.fixture(autouse=True)
def no_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))


def weighted(rows, k):
    if k >= len(rows):
        raise IndexError("no such row")
    scaled = np.empty(rows.shape[1])
    for i in range(rows.shape[1]):
        scaled[i] = rows[k, i] / (1.0 + i)
    return scaled


def total(rows, count):
    s = 0.0
    for k in range(count):
        for value in weighted(rows, k):
            s += value
    return s


def compiled_pair(monkeypatch, part, whole):
    """The part `weighted` and the kernel `total` that calls it."""
    inner = part(weighted)
    monkeypatch.setitem(globals(), "weighted", inner)
    return inner, whole(total)


@pytest.mark.parametrize("staged", [False, True])
def test_a_kernel_with_parts_gives_what_numba_gives_to_the_last_digit(
    staged, monkeypatch, tmp_path
):
    rows = np.random.default_rng(1).random((40, 7))
    _, plain = compiled_pair(monkeypatch, numba.njit, numba.njit)
    expected = plain(rows, 40)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "again"))
    monkeypatch.setitem(globals(), "weighted", weighted.py_func)
    _, kernel = compiled_pair(
        monkeypatch, compiled.inner(staged=staged), compiled.kernel(staged=staged)
    )
    assert kernel(rows, 40) == expected
    with pytest.raises(IndexError, match="no such row"):
        kernel(rows, 41)


def test_a_part_frees_what_it_allocates(monkeypatch):
    from numba.core.runtime import _nrt_python, rtsys

    rows = np.ones((40, 7))
    _, kernel = compiled_pair(monkeypatch, compiled.inner, compiled.kernel)
    kernel(rows, 40)
    counted = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        kernel(rows, 40)
        after = rtsys.get_allocation_stats()
    finally:
        if not counted:
            _nrt_python.memsys_disable_stats()
    assert after.alloc > before.alloc
    assert after.alloc - before.alloc == after.free - before.free


def test_a_part_has_no_machine_code_and_runs_as_python_from_python(monkeypatch):
    part, kernel = compiled_pair(monkeypatch, compiled.inner, compiled.kernel)
    kernel(np.ones((2, 2)), 2)
    (result,) = part.overloads.values()
    assert result.library.get_pointer_to_function(result.fndesc.llvm_func_name) == 0
    np.testing.assert_allclose(part(np.ones((2, 2)), 0), [1.0, 0.5])
    with pytest.raises(IndexError, match="no such row"):
        part(np.ones((2, 2)), 2)


def test_of_another_numba_its_own_decorator_is_taken(monkeypatch):
    monkeypatch.setattr(decorators, "_TRIED", False)
    part, kernel = compiled_pair(monkeypatch, compiled.inner, compiled.kernel)
    assert kernel(np.ones((2, 2)), 2) == pytest.approx(3.0)
    assert type(part) is type(kernel) is type(numba.njit(total))


def test_what_is_remembered_of_types_is_of_operations_that_numba_implements_itself():
    from verify.compiled import typing_memory

    @compiled.kernel
    def mixed(values, i, j):
        return values[i] + np.sum(values) * j

    assert mixed(np.ones(3), 0, 2) == 7.0
    assert typing_memory._signatures
    context = numba.core.registry.cpu_target.typing_context
    assert "resolve_function_type" not in vars(context)  # it is numba's own again
    remembered = {str(function) for function, *_ in typing_memory._signatures}
    assert not any("np.sum" in name or "function sum" in name for name in remembered)
    # and so is the code generator
    assert "create_library" not in vars(numba.core.registry.cpu_target.target_context.codegen())

"""Sources do nothing that fails only where the package is installed."""

import ast
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def compiled_functions():
    """Yield file and function of everything that numba compiles."""
    for file in (ROOT / "verify").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_bytes())):
            if isinstance(node, ast.FunctionDef) and any(
                "jit" in ast.dump(decorator) for decorator in node.decorator_list
            ):
                yield file, node


def test_no_kernel_asserts():
    """The package has a pytest plugin: pytest rewrites its asserts, which numba cannot compile."""
    found = [
        f"{file.name}:{node.lineno}"
        for file, function in compiled_functions()
        for node in ast.walk(function)
        if isinstance(node, ast.Assert)
    ]
    assert found == []


def test_no_two_modules_of_the_tests_have_one_name():
    """Their folders are no packages: the second of two modules of one name is not collected."""
    names = Counter(file.name for file in (ROOT / "tests").rglob("*.py"))
    assert [name for name, count in names.items() if count > 1] == ["conftest.py"]

"""Missing system libraries are asked of the loader and named with the apt line that brings them."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def requirements():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("system_requirements", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def loader_without(*absent):
    def load(library):
        if library in absent:
            raise OSError(library)

    return load


@pytest.fixture
def headers(tmp_path):
    (tmp_path / "Python.h").touch()
    return tmp_path


@pytest.fixture
def complete(headers):
    return {"load": loader_without(), "which": lambda _: "/opt/cc", "include": headers,
            "has_module": lambda _: True}  # fmt: skip


def test_missing_libraries_lead_to_the_exact_apt_line(requirements, complete):
    lacking = requirements.missing(
        **complete | {"load": loader_without("libGLU.so.1", "libEGL.so.1")}
    )
    assert requirements.apt_line(lacking) == (
        "apt-get install -y --no-install-recommends libegl1 libglu1-mesa"
    )


def test_the_guide_gives_the_same_apt_line(requirements):
    packages = {package for package, _ in requirements.LIBRARIES.values()} | {"gcc", "libc6-dev"}
    guide = (ROOT / "docs/guide/install.md").read_text()
    assert f"\n{requirements.apt_line(packages)}\n" in guide

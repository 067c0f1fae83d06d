"""A Python that the locked wheels are made for is found, whatever `python3` is."""

import subprocess
import sys

import pytest

# Runs the code that it is given under the real Python, which now says that it is another one.
PRETENDER = """#!/bin/bash
exec {python} -c 'import sys
sys.version_info = {version}
code = sys.argv[2]
sys.argv = ["-c", *sys.argv[3:]]
exec(code)' "$@"
"""
REFUSING_SHIM = "#!/bin/sh\necho 'shim: python3.12: command not found' >&2\nexit 127\n"


@pytest.fixture
def programs(tmp_path):
    """Return a function that puts a program at the front of PATH, and that PATH."""
    directory = tmp_path / "bin"
    directory.mkdir()

    def put(name, text):
        (directory / name).write_text(text)
        (directory / name).chmod(0o755)
        return directory / name

    return put, f"{directory}:/usr/bin:/bin"


def find_python(root, path, home, **changes):
    return subprocess.run(
        [root / ".ci/find-python"],
        env={"PATH": path, "HOME": str(home)} | changes,
        capture_output=True,
        text=True,
        timeout=60,
    )


def pretender(version):
    return PRETENDER.format(python=sys.executable, version=version)


def passing_on_to_this_python():
    return f'#!/bin/sh\nexec {sys.executable} "$@"\n'


def test_older_python3_and_refusing_shims_are_passed_over(root, tmp_path, programs):
    put, path = programs
    put("python3", pretender((3, 11, 7)))
    put("python3.12", REFUSING_SHIM)
    put("python3.13", REFUSING_SHIM)
    put("python3.14", REFUSING_SHIM)
    put("python", passing_on_to_this_python())
    found = find_python(root, path, tmp_path)
    assert found.returncode == 0, found.stderr
    version = subprocess.check_output(
        [found.stdout.strip(), "-c", "import sys; print(sys.version_info[:2] >= (3, 12))"]
    )
    assert version.strip() == b"True"

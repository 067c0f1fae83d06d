"""A file system of a few kilobytes, which fills up."""

import subprocess
from contextlib import contextmanager

import pytest

__all__ = ["SmallDisk", "small_disk"]


class SmallDisk:
    """A tmpfs mounted at `root`."""

    def __init__(self, root):
        self.root = root

    def resize(self, size):
        """Make it as large as said (``"64k"``); what is on it stays."""
        subprocess.run(
            ["mount", "-o", f"remount,size={size}", str(self.root)], check=True, capture_output=True
        )

    def fill(self):
        """Take all room that is left."""
        block = b"\0" * 4096
        with (self.root / "filler").open("ab", buffering=0) as stream:
            try:
                while stream.write(block) == len(block):
                    pass
            except OSError:
                pass

    def empty(self):
        """Give the room back."""
        (self.root / "filler").unlink()


@contextmanager
def small_disk(root, size):
    """Mount one, or skip the test where that is not allowed."""
    root.mkdir(parents=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(root)]
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except FileNotFoundError:
        pytest.skip("needs mount")
    if done.returncode:
        pytest.skip(f"may not mount a small disk: {done.stderr.decode().strip()}")
    try:
        yield SmallDisk(root)
    finally:
        subprocess.run(["umount", "-l", str(root)], capture_output=True, check=True)

"""A file system of a few kilobytes, which fills up."""

import errno
import json
import os
import re
import subprocess
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from verify.cli import main

__all__ = ["SmallDisk", "by_command", "in_this_process", "named_until_it_fits", "small_disk"]

PAGE = 4096


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
        block = b"\0" * PAGE
        with (self.root / "filler").open("ab", buffering=0) as stream:
            try:
                while stream.write(block) == len(block):
                    pass
            except OSError:
                pass

    def leave(self, size):
        """Take all room but so many bytes."""
        self.fill()
        filler = self.root / "filler"
        os.truncate(filler, max(0, filler.stat().st_size - size))

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


def _files_of(disk):
    return {file for file in disk.root.rglob("*") if file.is_file() and file.name != "filler"}


def _is_whole(file):
    match file.suffix:
        case ".json":
            return bool(json.loads(file.read_text()))
        case ".vtu" | ".svg" | ".html" | ".xml":
            return file.read_text().rstrip().endswith(">")
        case ".png" | ".gif" | ".webp":
            with Image.open(file) as image:
                image.seek(getattr(image, "n_frames", 1) - 1)
                return image.load() is not None
        case ".zip":
            with zipfile.ZipFile(file) as archive:
                return archive.testzip() is None
        case ".npz":
            with np.load(file) as stored:
                return all(stored[name] is not None for name in stored.files)
    return file.read_text().endswith("\n")


def named_until_it_fits(disk, write):
    """Return the files that `write` named as it failed for want of room, as names on the disk."""
    named = []
    for pages in (*range(16), *range(16, 64, 8), 64, 128, 256):
        disk.leave(PAGE * pages)
        failed = write()
        assert all(map(_is_whole, _files_of(disk)))  # a .partial is no whole one
        assert not list(disk.root.rglob("*.partial"))
        if failed is None:
            return named
        named.append(str(Path(failed).relative_to(disk.root)))
    raise AssertionError(f"it never fits: {named}")


def in_this_process(write):
    """Return `write` such that it gives the name in the error of a full disk, or None."""

    def attempt():
        try:
            write()
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise
            return error.filename
        return None

    return attempt


def by_command(capsys, *arguments):
    """Return the command as a function that gives the name in its one line of error, or None."""

    def attempt():
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr().err
        if code == 0:
            return None
        assert code == 3, said
        assert said.count("\n") == 1
        return re.search(r"No space left on device \((.*)\); what is finished stays", said)[1]

    return attempt

"""Files that a user's own program may start from."""

import shutil
from pathlib import Path

from verify.foreign.records import PROGRAMS
from verify.whole_files import asked_place


def write_template(folder: Path) -> list[Path]:
    """Write the reader and writer of the exchange and the example into `folder`."""
    files = [folder / name for name in ("exchange_files.py", "example.py")]
    with asked_place(folder):
        for file in files:
            shutil.copyfile(PROGRAMS / file.name, file)
    return files

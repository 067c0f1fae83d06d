"""Record of a study: findings, versioned JSON, and the same numbers as CSV."""

from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from verify.errors import InputError
from verify.files import write_json, write_whole
from verify.printable import csv_text
from verify.provenance import provenance
from verify.result import Verdict


@dataclass(frozen=True)
class Finding:
    """What a study has to say.

    Attributes
    ----------
    topic : str
    sentence : str
        With the numbers.
    expected : str
        The stated limit or the known result against which it is held.
    verdict : Verdict or None
        PASS if it came out as expected, FAIL if not, UNDECIDED if the numbers do not tell or there
        are none; None for what is only shown.
    """

    topic: str
    sentence: str
    expected: str
    verdict: Verdict | None


SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class Study:
    """What a study found.

    Attributes
    ----------
    findings : list of Finding
    seconds : float
        Wall time.
    """

    findings: list[Finding]
    seconds: float = 0.0

    def as_record(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return asdict(self)

    def rows(self) -> list[dict[str, Any]]:
        """Return the lines of its table, all with the same keys."""
        raise NotImplementedError


def write_study(directory: Path, kind: str, study: Study, command: str) -> Path:
    """Write ``<kind>.json`` and ``<kind>.csv``; each file is replaced in one step.

    Parameters
    ----------
    directory : Path
        Made if it is not there.
    kind : str
        Name of the study, ``slivers`` or ``energy``.
    study : Study
        Numbers that are not finite, for which JSON has no word, become null.
    command : str
        What was typed.

    Returns
    -------
    Path
        Of the JSON record.

    Raises
    ------
    InputError
        If the directory cannot be made because a file is in its place.
    """
    make_directory(directory)
    document = {
        "schema": SCHEMA,
        "kind": f"{kind} study",
        "command": command,
        "provenance": provenance(),
        **study.as_record(),
    }
    target = directory / f"{kind}.json"
    write_json(document, target)
    listed = study.rows()
    table = csv_text(list(listed[0]) if listed else [], listed)
    write_whole(directory / f"{kind}.csv", table)
    return target


def make_directory(directory: Path) -> None:
    """Make the directory, if it is not there, and see whether files can be made in it.

    Raises
    ------
    InputError
        If a file is in its place, or it may not be made or written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=directory):
            pass
    except (FileExistsError, NotADirectoryError):
        raise InputError("is a file; expected a directory to write into", str(directory)) from None
    except PermissionError:
        raise InputError("may not be written", str(directory)) from None

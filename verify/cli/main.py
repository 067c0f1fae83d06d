"""Entry point: parse, run the command, turn errors into one line and an exit code."""

import os
import sys
from collections.abc import Sequence

from verify.cli.parser import build_parser
from verify.cli.streams import printable_streams
from verify.errors import InputError, UnsupportedSceneError
from verify.printable import one_line
from verify.threads import pin_to_one_thread
from verify.whole_files import DISK_FAILURES


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv` (default: that of the process) and return its exit code."""
    pin_to_one_thread()
    with printable_streams():
        return _run(argv)


def _run(argv: Sequence[str] | None) -> int:
    arguments = build_parser().parse_args(argv)
    try:
        code: int = arguments.command(arguments)
        if sys.stdout is not None:  # closed by `>&-`
            sys.stdout.flush()
    except (InputError, UnsupportedSceneError) as error:
        return _fail(str(error), 2)
    except ModuleNotFoundError as error:
        if error.name != "numba":  # all else that may be missing is asked for by name
            raise
        return _fail(
            "this command needs numba, which is not installed: python -m pip install numba", 3
        )
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    except BrokenPipeError:  # `verify list | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ChildProcessError as error:
        return _fail(str(error), 3)
    except OSError as error:
        if isinstance(error, PermissionError) and error.filename:
            return _fail(f"{error.filename}: {error.strerror}", 2)
        if error.errno not in DISK_FAILURES:
            raise
        where = f" ({error.filename})" if error.filename else ""
        return _fail(
            f"{error.strerror}{where}; what is finished stays, the same command resumes it", 3
        )
    return code


def _fail(message: str, code: int) -> int:
    print(f"verify: error: {one_line(message)}", file=sys.stderr)
    return code

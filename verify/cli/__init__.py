"""The command ``verify``. Importing it is quick: a command imports what it needs when it runs."""

import os
import sys
from collections.abc import Sequence
from inspect import cleandoc
from textwrap import indent
from typing import Literal

from verify import __version__
from verify.cli.signatures import Member, Parser, add_commands, arguments_of, call
from verify.cli.streams import printable_streams
from verify.errors import InputError, RunStoppedError, UnsupportedSceneError
from verify.files import DISK_FAILURES
from verify.printable import one_line
from verify.processes import pin_to_one_thread

_EXAMPLES = """\
examples:
  verify list                                 the cases that come with the project
  verify describe statics/f3_inclined         what a case asks, in words
  verify run statics/f1_patch --out out       solve, compare, judge, report
  verify run -k demo --out out -j 2           all cases that mention 'demo', 2 at a time
  verify check my_case.toml                   validate an own case file without running
  verify run my_case.toml --out mine          run it
  verify report out                           render the report again

"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv` (default: ``sys.argv``) and return its exit code."""
    pin_to_one_thread()
    with printable_streams():
        return _run(argv)


def _run(argv: Sequence[str] | None) -> int:
    arguments = build_parser().parse_args(argv)
    try:
        code = call(arguments)
        if sys.stdout is not None:  # closed by `>&-`
            sys.stdout.flush()
    except (InputError, UnsupportedSceneError) as error:
        return _fail(str(error), 2)
    except ModuleNotFoundError as error:
        if error.name not in ("numba", "pyvista"):  # others are checked where they are needed
            raise
        missing = f"{error.name}, which is not installed: python -m pip install {error.name}"
        return _fail(f"this command needs {missing}", 3)
    except RunStoppedError as stop:
        return _fail(f"{stop}; the same command resumes it", 128 + stop.signum)
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


def build_parser() -> Parser:
    """Build the parser from the functions that are commands."""
    from verify.cli import baseline, cache, extend, look, play, run, solvers, study

    codes = (run.run.__doc__ or "").partition("exit codes:\n")[2]
    parser = Parser(
        prog="verify",
        description="Verify cutting simulations: solve scenes, compare, judge, report.",
        epilog=f"{_EXAMPLES}exit codes:\n{indent(cleandoc(codes), '  ')}",
    )
    parser.add_argument("--version", action="version", version=f"verify {__version__}")
    groups: dict[str, list[Member]] = {
        "run": [look.check, run.run, play.play],
        "look": [look.list_, look.describe, look.report, look.paraview],
        "compare": [study, baseline],
        "extend": [look.schema, extend.export, extend.import_, extend.conform, solvers],
        "look after": [cache, look.doctor, completion],
    }
    add_commands(parser, groups)
    return parser


def completion(shell: Literal["bash", "zsh"]) -> int:
    """Print a script that completes commands, options and cases in a shell.

    Parameters
    ----------
    shell
        the shell that shall read it

    Examples
    --------
      verify completion bash > ~/.local/share/bash-completion/completions/verify
      verify completion zsh > ~/.zfunc/_verify
    """
    import shtab

    from verify.scene import list_cases

    parser, function = build_parser(), "_verify_cases"
    for action in arguments_of(parser):
        if action.dest in ("case", "cases"):
            action.complete = {"bash": function, "zsh": function}  # type: ignore[attr-defined]
    names = " ".join(list_cases())  # of today
    functions = {
        "bash": f'{function}() {{ compgen -W \'{names}\' -- "$1"; compgen -f -- "$1"; }}',
        "zsh": f"{function}() {{ _alternative 'cases:case:({names})' 'files:file:_files' }}",
    }
    print(shtab.complete(parser, shell, preamble=functions))  # type: ignore[arg-type]
    return 0

"""Arguments of ``verify cache``."""

import argparse
from collections.abc import Callable
from pathlib import Path

__all__ = ["add_cache_command"]


def add_cache_command(add: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    """Add ``cache`` to the command line."""
    command = add(
        "cache",
        "list, clear or export the references that were solved before",
        "examples:\n  verify cache list\n  verify cache clear --outdated\n"
        '  verify cache clear "statics/*"\n  verify cache export references.zip statics/f3_inclined'
        "\n  verify run statics/f3_inclined --references references.zip\n\n"
        "A reference is kept under a hash of its scene, of the code and of the versions of what\n"
        "it stands on. The folder is VERIFY_CACHE, else below XDG_CACHE_HOME or ~/.cache.",
    )
    actions = command.add_subparsers(metavar="ACTION", dest="action", required=True)
    listing = actions.add_parser("list", help="what is kept", description="What is kept.")
    listing.add_argument("--json", action="store_true", help="print JSON")
    text = "remove references"
    clear = actions.add_parser("clear", help=text, description=f"{text.capitalize()}.")
    clear.add_argument(
        "cases", metavar="CASE", nargs="*", help="name or pattern (default: all that is kept)"
    )
    clear.add_argument(
        "--outdated", action="store_true", help="only those of another code or other versions"
    )
    text = "write the references of cases into one file, for runs without FEniCSx"
    export = actions.add_parser("export", help=text, description=f"{text.capitalize()}.")
    export.add_argument("bundle", metavar="BUNDLE", type=Path, help="zip file to write")
    export.add_argument("cases", metavar="CASE", nargs="+", help="name, pattern or file of a case")

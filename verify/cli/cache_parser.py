"""Arguments of ``verify cache``."""

from pathlib import Path

from verify.cli.shared_arguments import Add, add_action, add_json


def add_cache_command(add: Add) -> None:
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
    listing = add_action(actions.add_parser, "list", "what is kept")
    add_json(listing)
    clear = add_action(actions.add_parser, "clear", "remove references")
    clear.add_argument(
        "cases", metavar="CASE", nargs="*", help="name or pattern (default: all that is kept)"
    )
    clear.add_argument(
        "--outdated", action="store_true", help="only those of another code or other versions"
    )
    export = add_action(
        actions.add_parser,
        "export",
        "write the references of cases into one file, for runs without FEniCSx",
    )
    export.add_argument("bundle", metavar="BUNDLE", type=Path, help="zip file to write")
    export.add_argument("cases", metavar="CASE", nargs="+", help="name, pattern or file of a case")

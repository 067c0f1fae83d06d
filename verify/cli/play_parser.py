"""Arguments of ``verify play``."""

from pathlib import Path

from verify.cli.argument_types import positive
from verify.cli.shared_arguments import Add, add_case, add_json


def add_play_command(add: Add) -> None:
    """Add ``play`` to the command line."""
    command = add(
        "play",
        "play a cutting scene as a simulator would, and show or draw it",
        "examples:\n  verify play thesis/hand_straight --out hand.gif\n"
        "  verify play thesis/square_dissected --out square.gif --records steps.csv\n"
        "  verify play thesis/hand_straight            in a window, where there is a display\n"
        "  verify play my_case.toml --window --stroke my_stroke.toml\n\n"
        "In a window the left mouse button is the scalpel; the stroke is written as a tool_path\n"
        "that can be pasted into a case file.",
    )
    add_case(command)
    command.add_argument(
        "--out", metavar="FILE", type=Path, help="draw off-screen into this file: .gif, .mp4 "
        "(needs ffmpeg), or .png (the last frame)",
    )  # fmt: skip
    command.add_argument("--window", action="store_true", help="open a window")
    command.add_argument(
        "--stroke", metavar="TOML", type=Path, default=Path("stroke.toml"),
        help="window: where the stroke of the mouse is written (default: stroke.toml)",
    )  # fmt: skip
    command.add_argument(
        "--frames", metavar="N", type=int, default=48, help="frames drawn (default: 48)"
    )
    command.add_argument(
        "--zoom", metavar="F", type=positive, default=1.0,
        help="look at the wound, F times as near (default: 1, the whole body)",
    )  # fmt: skip
    command.add_argument(
        "--records", metavar="CSV", type=Path, help="write what every step cost and did"
    )
    add_json(command, "print the summary as JSON")

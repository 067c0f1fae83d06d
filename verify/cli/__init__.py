"""The command ``verify``. Importing it is quick: a command imports what it needs when it runs."""

from verify.cli.main import main

__all__ = ["main"]

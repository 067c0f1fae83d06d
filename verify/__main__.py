"""``python -m verify``: the same as the command ``verify``."""

import sys

from verify.cli import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())

"""``verify data``: fetch data that cases can use but that do not come with the project."""

import argparse
import json

from verify.simulator.anatomy.fetching import fetch_anatomy
from verify.simulator.anatomy.store import store_folder


def execute(arguments: argparse.Namespace) -> int:
    """Fetch the anatomy."""
    folder = arguments.out or store_folder()
    files = fetch_anatomy(folder, arguments.wheel)
    if arguments.json:
        print(json.dumps([str(file) for file in files], indent=2))
    else:
        for file in files:
            print(file)
    return 0

"""``verify cache``: the references that were solved before."""

import argparse
import json
from fnmatch import fnmatch
from typing import Any

from verify.errors import InputError
from verify.runner import select_cases
from verify.runner.fingerprint import cache_folder
from verify.runner.references import Entry, ReferenceCache, write_bundle


def execute(arguments: argparse.Namespace) -> int:
    """List, clear or export."""
    cache = ReferenceCache(cache_folder())
    if arguments.action == "list":
        return _list(cache, arguments.json)
    if arguments.action == "clear":
        return _clear(cache, arguments.cases, arguments.outdated)
    scenes = select_cases(arguments.cases, None, "heavy")
    if not scenes:
        raise InputError(f"no case matches {' '.join(arguments.cases)}")
    entries = write_bundle(arguments.bundle, scenes, cache)
    size = arguments.bundle.stat().st_size / 1e6
    print(f"{arguments.bundle}: {len(entries)} levels of {len(scenes)} cases, {size:.2f} MB")
    return 0


def _list(cache: ReferenceCache, as_json: bool) -> int:
    rows = [_row(cache, entry) for entry in cache.entries()]
    if as_json:
        print(json.dumps({"folder": str(cache.root), "entries": rows}, indent=2))
        return 0
    for row in rows:
        state = "outdated" if row["outdated"] else "current"
        print(
            f"{row['case']}  level {row['level']}  {row['unknowns']} unknowns  "
            f"{row['bytes'] / 1e6:.2f} MB  {row['made']}  DOLFINx {row['dolfinx']}  {state}"
        )
    total = sum(row["bytes"] for row in rows) / 1e6
    print(f"{len(rows)} references, {total:.1f} MB in {cache.root}")
    return 0


def _row(cache: ReferenceCache, entry: Entry) -> dict[str, Any]:
    return {
        "case": entry.case,
        "level": entry.level,
        "unknowns": entry.record.unknowns,
        "bytes": cache.size(entry),
        "made": entry.made,
        "dolfinx": entry.dolfinx,
        "commit": entry.origin.get("commit"),
        "outdated": entry.outdated,
        "key": entry.key,
    }


def _clear(cache: ReferenceCache, patterns: list[str], outdated: bool) -> int:
    chosen = [
        entry
        for entry in cache.entries()
        if (not patterns or any(fnmatch(entry.case, pattern) for pattern in patterns))
        and (entry.outdated or not outdated)
    ]
    if patterns and not chosen:
        raise InputError(f"nothing is kept for {' '.join(patterns)}", str(cache.root))
    cache.remove(chosen)
    damaged = cache.remove_damaged()
    print(f"{len(chosen)} references removed" + (f", and {damaged} damaged" if damaged else ""))
    return 0

"""List, clear or export the references that were solved before.

Examples
--------
  verify cache list
  verify cache clear --outdated
  verify cache clear "statics/*"
  verify cache export references.zip statics/f3_inclined
  verify run statics/f3_inclined --references references.zip

A reference is kept under a hash of its scene, of the code and of the versions of what
it stands on. The folder is VERIFY_CACHE, else below XDG_CACHE_HOME or ~/.cache.
"""

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from verify.cli.signatures import Actions, Arg, AsJson
from verify.cli.streams import print_answer
from verify.errors import InputError

if TYPE_CHECKING:
    from verify.runner.references import ReferenceCache


def _cache() -> "ReferenceCache":
    from verify.runner.fingerprint import cache_folder
    from verify.runner.references import ReferenceCache

    return ReferenceCache(cache_folder())


def list_(*, as_json: AsJson = False) -> int:
    """List the references that are kept."""
    cache = _cache()
    rows: list[dict[str, Any]] = [
        {
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
        for entry in cache.entries()
    ]
    lines = [
        f"{row['case']}  level {row['level']}  {row['unknowns']} unknowns  "
        f"{row['bytes'] / 1e6:.2f} MB  {row['made']}  DOLFINx {row['dolfinx']}  "
        f"{'outdated' if row['outdated'] else 'current'}"
        for row in rows
    ]
    total = sum(row["bytes"] for row in rows) / 1e6
    lines.append(f"{len(rows)} references, {total:.1f} MB in {cache.root}")
    return print_answer(as_json, {"folder": str(cache.root), "entries": rows}, lines)


def clear(cases: Annotated[Sequence[str], Arg("CASE")] = (), *, outdated: bool = False) -> int:
    """Remove references.

    Parameters
    ----------
    cases
        name or pattern (default: all that is kept)
    outdated
        only entries of another code or other versions
    """
    cache = _cache()
    chosen = [
        entry
        for entry in cache.entries()
        if (not cases or any(fnmatch(entry.case, pattern) for pattern in cases))
        and (entry.outdated or not outdated)
    ]
    if cases and not chosen:
        raise InputError(f"nothing is kept for {' '.join(cases)}", str(cache.root))
    cache.remove(chosen)
    damaged = cache.remove_damaged()
    print(f"{len(chosen)} references removed" + (f", and {damaged} damaged" if damaged else ""))
    return 0


def export(
    bundle: Annotated[Path, Arg("BUNDLE")], cases: Annotated[Sequence[str], Arg("CASE")]
) -> int:
    """Write the references of cases into one file, for runs without FEniCSx.

    Parameters
    ----------
    bundle
        zip file to write
    cases
        name, pattern or file of a case
    """
    from verify.runner.references import write_bundle
    from verify.runner.selection import select_cases

    if not (scenes := select_cases(cases, None, "heavy")):
        raise InputError(f"no case matches {' '.join(cases)}")
    entries = write_bundle(bundle, scenes, _cache())
    size = bundle.stat().st_size / 1e6
    print(f"{bundle}: {len(entries)} levels of {len(scenes)} cases, {size:.2f} MB")
    return 0


ACTIONS = Actions((list_, clear, export))

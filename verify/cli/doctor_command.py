"""``verify doctor``: what is here, what works, what is missing and how to get it."""

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict


def execute(arguments: argparse.Namespace) -> int:
    """Examine the installation; exit code 3 if something that a full run needs is missing."""
    if arguments.compile:
        return _compile(arguments.json)
    from verify.doctor import examine

    findings = examine()
    missing = [finding for finding in findings if finding.needed and not finding.works]
    if arguments.json:
        print(json.dumps([finding.as_json() for finding in findings], indent=2))
        return 3 if missing else 0
    width = max(len(finding.name) for finding in findings)
    for finding in findings:
        mark = "ok     " if finding.works else "MISSING" if finding.needed else "absent "
        print(f"{mark}  {finding.name:<{width}}  {finding.found}")
        if finding.cure and not finding.works:
            print(f"         {'':<{width}}  → {finding.cure}")
    return 3 if missing else 0


def _compile(as_json: bool) -> int:
    from verify.first_use import FirstUseError, compile_all

    try:
        use = compile_all()
    except FirstUseError as error:
        print(f"verify: error: {error}", file=sys.stderr)
        return 3
    if as_json:
        print(json.dumps(asdict(use), indent=2))
        return 0
    whole = sum(use.seconds.values())
    print(f"{use.kernels} compilations in {use.wall:.1f} s, {whole:.1f} s of processor time")
    if whole > 0.0:
        print("\nseconds  module")
    for name, seconds in _by_module(use.seconds).items():
        if seconds >= 0.05:
            print(f"{seconds:7.1f}  {name}")
    return 0


def _by_module(seconds: dict[str, float]) -> dict[str, float]:
    found: Counter[str] = Counter()
    for kernel, spent in seconds.items():
        found[kernel.partition(":")[0]] += spent  # type: ignore[assignment]
    return dict(found.most_common())

"""``verify doctor``: what is here, what works, what is missing and how to get it."""

import argparse
import json

__all__ = ["execute"]


def execute(arguments: argparse.Namespace) -> int:
    """Examine the installation; exit code 3 if something that a full run needs is missing."""
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

"""The second program as a whole: what it cannot confirm of the claims of a file.

    python -m tests.proofs.second_program results/certificates.json

It shares no code with gearlib. Uniqueness it confirms in a share of the radius, 1/1000 by default.
"""

import json
import sys

from tests.proofs import checker
from tests.proofs.ranges import range_faults

#: What is no claim.
_OTHERS = ("count", "refusal")


def faults(claim, share=1e-3):
    """Return what is not confirmed of a claim of any kind, a list of words."""
    return range_faults(claim) if claim["claim"] == "range" else checker.faults(claim, share)


def main(path):
    """Print the faults of a file; return how many claims have any."""
    with open(path, encoding="utf-8") as file:
        claims = [row for row in json.load(file) if row["claim"] not in _OTHERS]
    wrong = 0
    for claim in claims:
        found = faults(claim)
        wrong += bool(found)
        if found:
            print(claim["damping"], claim["claim"], claim.get("tuning", claim.get("start")), *found)
    print(f"{len(claims) - wrong} of {len(claims)} claims are confirmed")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))

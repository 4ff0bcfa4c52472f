"""The table of proofs about the orbits of all dampings: a row for each certificate.

Enclosures, see `docs/theory/proofs.md`, are far narrower than the digits printed here.
"""

#: Phases of contact as letters, by contact code.
_LETTERS = {1: "N", 0: "B", -1: "I"}
#: Columns; of a range `tuning` is where it begins, `until` where it ends.
_HEAD = ["damping", "claim", "tuning", "until", "contacts", "lowest"]
#: Columns that are those of the certificates.
_SAID = ["stability", "reason"]


def rows(certificates):
    """Yield the table of the certificates of `gearlib.studies.certificates`.

    Refusals and counts are left out. lowest: the least displacement of the orbit, static
    deflections.
    """
    yield _HEAD + _SAID
    for row in certificates:
        if row["claim"] not in ("count", "refusal"):
            tuning, until = row.get("tuning", row.get("start")), row.get("stop")
            until = "" if until is None else _decimal(until)
            contacts = "".join(_LETTERS[code] for code in row.get("pattern", ()))
            lowest = _decimal(row["displacement_min"]) if "displacement_min" in row else ""
            name = ", ".join(row[key] for key in ("damping", "model") if key in row)
            own = [name, row["claim"], _decimal(tuning), until, contacts, lowest]
            yield own + [row[name] for name in _SAID]


def _decimal(value):
    """Return a float that is written as its bits, or an end of an enclosure, as a decimal."""
    number = float.fromhex(value) if isinstance(value, str) else float(value[0])
    return f"{number:.10g}"

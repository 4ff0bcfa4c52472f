"""What is proven about the orbits of a statement, in words, from certificates.

A sentence says no more than its certificates, see `docs/theory/proofs.md`: their enclosures are far
narrower than the digits printed here. Empty where nothing is proven.
"""

from decimal import Decimal

from gearlib.studies.certificates import ABOVE, TWO
from gearlib.studies.claims.data import NoData

#: The tunings of Fig. 5 at which the paper finds oil damping alone unsteady.
_UNSTEADY = (0.60, 0.66, 0.78)
_KEPT = [1]


class Proven:
    """Certificates as of `gearlib.studies.certificates`, asked for by what a sentence needs."""

    def __init__(self, data, rows):
        self.data, self.rows = data, rows

    def of(self, name, claim, tuning=None):
        """Return the claims of a kind and a damping, at a tuning."""
        return [
            row
            for row in self.rows
            if row["damping"] == name
            and row["claim"] == claim
            and (tuning is None or abs(float.fromhex(row["tuning"]) - tuning) < 1e-9)
        ]

    def tunings(self, name, claim, kept=False):
        """Return the tunings of special points, ascending; `kept`: without loss of contact."""
        rows = [row for row in self.of(name, claim) if not kept or row["pattern"] == _KEPT]
        return sorted(float(row["tuning"][0]) for row in rows)


def _listed(tunings, digits=10):
    return ", ".join(f"{tuning:.{digits}g}" for tuning in tunings)


def _ranges(proven, name, stability):
    """Return the ranges of tunings at all of which an orbit without loss of contact lives."""
    rows = [row for row in proven.of(name, "range") if row["stability"] == stability]
    ends = sorted(tuple(float.fromhex(row[end]) for end in ("start", "stop")) for row in rows)
    return " and ".join(f"from {low:g} to {high:g}" for low, high in ends if high > 0.6)


def _tongues(proven):
    (name,) = proven.data.names(False, False)[:1]
    rows = [[float(row[end][0]) for end in ("start", "stop")] for row in proven.of(name, "tongue")]
    words = [f"{low:.10g} to {high:.10g}" for low, high in sorted(rows) if 0.6 < low < 0.8]
    kept = _ranges(proven, name, "undecided")
    if not (words and kept):
        return ""
    return (
        f"an orbit without loss of contact lives at every nu {kept}, both multipliers of modulus "
        f"1; it is unstable from {' and '.join(words)}, and touches the flank at "
        f"{_touched(proven, name)}"
    )


def _touched(proven, name):
    return _listed(nu for nu in proven.tunings(name, "grazing", kept=True) if nu > 0.7)


def _damped_range(proven):
    words = []
    for name in proven.data.names(material=True):
        kept = _ranges(proven, name, "stable")
        folds = [nu for nu in proven.tunings(name, "fold") if nu > 0.8]
        if kept:
            text = f"{name}: a stable orbit without loss of contact lives at every nu {kept} and "
            text += f"touches the flank at {_touched(proven, name)}"
            text += f"; orbits with bounces have folds at {_listed(folds)}" if folds else ""
            words.append(text)
    return "; ".join(words)


def _above(proven):
    settled = [
        name
        for name in proven.data.names(material=True)
        if any(row["pattern"] == _KEPT for row in proven.of(name, "motion", ABOVE))
    ]
    oil = [
        name
        for name in proven.data.names(False, True)
        if any(_neutral(row) for row in proven.of(name, "orbit", ABOVE))
    ]
    words = (
        f"at nu = {ABOVE:g} the motion from rest tends to an orbit without loss of contact with "
    )
    words += " and ".join(settled)
    if oil:
        words += f"; with {' and '.join(oil)} both multipliers of that orbit have modulus 1"
    return words if settled else ""


def _neutral(row):
    """Return whether an orbit without loss of contact has both multipliers on the unit circle."""
    return row["pattern"] == _KEPT and row["stability"] == "undecided" and _is_one(row)


def _is_one(row):
    return all(float(end) == 1.0 for end in row["determinant"])


def _planes(proven):
    words = []
    for name in proven.data.names(material=True) + proven.data.names(False, True):
        at = {float.fromhex(row["tuning"]) for row in proven.of(name, "motion")} - {*TWO, ABOVE}
        if at:
            words.append(f"{name} at {', '.join(f'{nu:.2f}' for nu in sorted(at))}")
    text = f"the motion from rest tends to an orbit of one mesh period: {'; '.join(words)}"
    for name in proven.data.names(False, True):
        neutral, unstable = [], []
        for nu in _UNSTEADY:
            for row in proven.of(name, "orbit", nu):
                if row["pattern"] == _KEPT:
                    neutral += [nu] if _neutral(row) else []
                    unstable += [nu] if row["stability"] == "unstable" else []
        if neutral:
            at = ", ".join(f"{nu:.2f}" for nu in neutral)
            text += f"; {name} at {at}: both multipliers of the orbit without loss have modulus 1"
        if unstable:
            text += f", at {', '.join(f'{nu:.2f}' for nu in unstable)} it is unstable"
    return text if words else ""


def _two(proven):
    (name,) = proven.data.names(True, False)[:1]
    words = []
    for nu in TWO:
        reached = proven.of(name, "motion", nu)
        stable = [row for row in proven.of(name, "orbit", nu) if row["stability"] == "stable"]
        deep = sorted(stable, key=_lowest)
        if not reached or len(deep) != 2 or _meet(*deep):
            return ""
        met = [_meet(row, reached[0]) for row in deep]
        if met not in ([True, False], [False, True]):
            return ""
        which, (large, small) = "large" if met[0] else "small", map(_lowest, deep)
        words.append(
            f"the {which} ones at {nu:g} (lowest x of the small ones {small:.4g}, of the large "
            f"{large:.4g}; near after {reached[0]['periods']} mesh periods)"
        )
    return (
        f"{name}: at both tunings a stable orbit with small bounces and one with large ones exist; "
        f"the motion from rest tends to {' and to '.join(words)}"
    )


def _lowest(row):
    return float(row["displacement_min"][0])


def _meet(row, other):
    """Return whether the enclosures of the smallest displacement of two orbits meet."""
    (low, high), (first, last) = (map(Decimal, one["displacement_min"]) for one in (row, other))
    return low <= last and first <= high


#: id of the statement -> sentence from the certificates.
_SENTENCES = {
    "P4": _tongues,
    "P6": _damped_range,
    "P7": _above,
    "P10": _planes,
    "P11": _two,
}


def words_for(identifier, proven):
    """Return what is proven about a statement, empty where nothing is."""
    if identifier not in _SENTENCES or not proven.rows:
        return ""
    try:
        return _SENTENCES[identifier](proven)
    except NoData:
        return ""

"""References in 50 digits, and what of them lies in files.

Motions are those of `tests.independent`. References that take long lie in files, 20 of their
digits; what is not there, as where another machine draws other random numbers, is computed, with a
warning. `make references` renews the files; `test_references.py` computes some entries anew in
every test.
"""

import hashlib
import json
import warnings
from pathlib import Path

import mpmath

from tests.independent.systems import move

mpmath.mp.dps = 50
FOLDER = Path(__file__).parent
_DIGITS = 20


def propagate(
    contact_ratio, stiffness_ratio, damping_ratio, backlash_damping_ratio, backlash_ratio,
    tuning, periods, state=(0.0, 0.0),
):  # fmt: skip
    """Return the motion of a pair over some mesh periods from a state (x, v), in 50 digits.

    The list has the final state (x, v), followed by events (phase, contact before, contact after,
    v).
    """
    with mpmath.workdps(50):
        epsilon, kappa = mpmath.mpf(contact_ratio), mpmath.mpf(stiffness_ratio)
        pair = {
            "kind": "GearPair",
            "max_stiffness": 1 / (kappa + (1 - kappa) * (epsilon - 1)),
            "stiffness_ratio": kappa,
            "contact_ratio": epsilon,
            "reduced_mass": mpmath.mpf(1),
            "load": mpmath.mpf(1),
            "backlash": backlash_ratio,
            "material_damping": 2 * mpmath.mpf(damping_ratio),
            "backlash_damping": 2 * mpmath.mpf(backlash_damping_ratio),
        }
        motion = move(pair, tuning, periods, state, context=mpmath.mp)
        events = [(event.phase, event.before, event.after, event.rate) for event in motion.events]
        return [motion.mesh_state(), *events]


def propagate_pair(pair, tuning, periods, state=(0.0, 0.0)):
    """Return the motion of a `GearPair` in 50 digits, see `propagate`."""
    names = ("contact_ratio", "stiffness_ratio", "damping_ratio", "backlash_damping_ratio")
    ratios = [getattr(pair, name) for name in (*names, "backlash_ratio")]
    return propagate(*ratios, tuning, periods, state)


def free_map(decay, square, t):
    """Return the map of (x, x') over the time t for x'' + 2 decay x' + square x = 0."""
    root = mpmath.sqrt(mpmath.mpc(decay * decay - square))
    cosh, sinh = mpmath.cosh(root * t), mpmath.sinh(root * t) / root if root else t
    rows = [[cosh + decay * sinh, sinh], [-square * sinh, cosh - decay * sinh]]
    return (mpmath.matrix(rows) * mpmath.exp(-decay * t)).apply(mpmath.re)


def contact_map(contact_ratio, stiffness_ratio, damping, tuning):
    """Return the map of (x, dx/dtau) over a mesh period without contact loss, a 2x2 matrix.

    The period begins in the middle of double contact, which lasts `half` before and after it.
    """
    epsilon, kappa, beta, nu = map(
        mpmath.mpf, map(mpmath.mpmathify, (contact_ratio, stiffness_ratio, damping, tuning))
    )
    mean = kappa + (1 - kappa) * (epsilon - 1)
    half = mpmath.pi * (epsilon - 1)
    double_contact = free_map(beta / nu, 1 / mean / nu**2, half)
    single_contact = free_map(beta / nu, kappa / mean / nu**2, 2 * (mpmath.pi - half))
    return double_contact * single_contact * double_contact


def from_rest(decay, square, load, x, t):
    """Return (x, x') at the time t for x'' + 2 decay x' + square x = load, from rest at x."""
    with mpmath.workdps(50):
        decay, square, load, x, t = map(mpmath.mpf, (decay, square, load, x, t))
        matrix = free_map(decay, square, t)
        if not square:
            return x + load * (t - matrix[0, 1]) / (2 * decay), load * matrix[0, 1]
        rest = load / square
        return rest + matrix[0, 0] * (x - rest), matrix[1, 0] * (x - rest)


class StoredReferences:
    """The stored references of one test module, in a file of their own."""

    #: All instances.
    known: list = []
    #: Whether references are computed and recorded, as by `python -m tests.references`.
    recording = False

    def __init__(self, name):
        self.path = FOLDER / f"{name}.json"
        self.entries = json.loads(self.path.read_text("utf-8")) if self.path.exists() else {}
        self.recorded: dict = {}
        StoredReferences.known.append(self)

    def rows(self, function, *arguments):
        """Return the rows of numbers of a function of 50 digits, stored ones if possible."""
        key = reference_key(function, *arguments)
        if StoredReferences.recording:
            self.recorded[key] = number_strings(function(*arguments))
        known = self.recorded if StoredReferences.recording else self.entries
        if key not in known:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return function(*arguments)
        return [tuple(map(mpmath.mpf, row.split())) for row in known[key]]

    def write(self):
        """Write the recorded references, one line for each."""
        lines = [f"{json.dumps(key)}: {json.dumps(self.recorded[key])}" for key in self.recorded]
        text = ",\n".join(sorted(lines))
        self.path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def reference_key(function, *arguments):
    """Return the key of a stored reference: a digest of the function name and exact arguments."""
    return hashlib.sha256(repr((function.__name__, *arguments)).encode()).hexdigest()[:16]


def number_strings(rows):
    """Return each row of numbers as a string."""
    return [" ".join(mpmath.nstr(value, _DIGITS) for value in row) for row in rows]

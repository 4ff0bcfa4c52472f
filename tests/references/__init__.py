"""An independent second code for every model, and what of it lies in files.

==========================  ======================================================================
module                      responsibility
==========================  ======================================================================
``described_models``        a model as plain values, from its public attributes
``reference_equations``     the equations of motion, assembled from a description
``reference_trains``        the same of gear trains
``reference_motion``        a motion event by event, in floats or many digits
``reference_run_up``        the same along a course of speed and load, and by scipy
``reference_slopes``        derivatives in 50 digits, by differences
``reference_elimination``   gain, offset and shaft phase of a sensor by least squares
==========================  ======================================================================

None of them imports the library. References in 50 digits that take long lie in files, 20 of their
digits; what is not there, as where another machine draws other random numbers, is computed, with a
warning. `make references` renews the files; `test_references.py` computes some entries anew in
every test.
"""

import hashlib
import json
import warnings
from pathlib import Path

import mpmath

from tests.references.reference_motion import move

mpmath.mp.dps = 50
FOLDER = Path(__file__).parent
_DIGITS = 20


def propagate(epsilon, kappa, beta, beta_m, backlash, tuning, periods, state=(0.0, 0.0)):
    """Return (x, v, events) of a pair by its ratios in 50 digits.

    `events` is a list of (phase, contact before, contact after, v).
    """
    with mpmath.workdps(50):
        epsilon, kappa = mpmath.mpf(epsilon), mpmath.mpf(kappa)
        pair = {
            "kind": "GearPair",
            "max_stiffness": 1 / (kappa + (1 - kappa) * (epsilon - 1)),
            "stiffness_ratio": kappa,
            "contact_ratio": epsilon,
            "reduced_mass": mpmath.mpf(1),
            "load": mpmath.mpf(1),
            "backlash": backlash,
            "material_damping": 2 * mpmath.mpf(beta),
            "backlash_damping": 2 * mpmath.mpf(beta_m),
        }
        motion = move(pair, tuning, periods, state, context=mpmath.mp)
        events = [(one.phase, one.before, one.after, one.rate) for one in motion.events]
        return (*motion.mesh_state(periods), events)


def of_pair(pair, tuning, periods, state=(0.0, 0.0)):
    """Return (x, v, events) of a pair in 50 digits, see `propagate`, by its public ratios."""
    names = ("contact_ratio", "stiffness_ratio", "damping_ratio", "backlash_damping_ratio")
    ratios = [getattr(pair, name) for name in (*names, "backlash_ratio")]
    return propagate(*ratios, tuning, periods, state)


def map_of_contact(contact_ratio, stiffness_ratio, damping, tuning):
    """Return the map of (x, dx/dtau) over a period of a mesh that is never lost."""
    epsilon, kappa, beta, nu = map(
        mpmath.mpf, map(mpmath.mpmathify, (contact_ratio, stiffness_ratio, damping, tuning))
    )
    mean = kappa + (1 - kappa) * (epsilon - 1)
    half = mpmath.pi * (epsilon - 1), 2 * mpmath.pi * (2 - epsilon)
    matrix = mpmath.eye(2)
    for c, length in ((1, half[0]), (kappa, half[1]), (1, half[0])):
        # The closed form by complex roots of the characteristic equation.
        root = mpmath.sqrt(mpmath.mpc(beta**2 - c / mean)) / nu
        a = beta / nu
        cosh, sinh = mpmath.cosh(root * length), mpmath.sinh(root * length) / root
        decay = mpmath.exp(-a * length)
        rows = [[cosh + a * sinh, sinh], [-c / mean / nu**2 * sinh, cosh - a * sinh]]
        matrix = mpmath.matrix(rows) * decay * matrix
    return matrix.apply(mpmath.re)


def from_rest(decay, square, load, x, t):
    """Return (x, x') after t of x'' + 2 decay x' + square x = load from rest at x.

    Its rates and where it rests are of floats, all else in 50 digits.
    """
    with mpmath.workdps(50):
        if not square:
            final = load / (2 * decay)
            gone = -mpmath.expm1(-2 * decay * t)
            return x + final * t - final * gone / (2 * decay), final * gone
        rest = load / square
        away, root = x - rest, mpmath.sqrt(mpmath.mpc(decay * decay - square))
        if not root:
            left = mpmath.exp(-decay * t) * away
            return rest + left * (1 + decay * t), -left * decay * decay * t
        one, other = -decay + root, -decay - root
        waves = [mpmath.exp(rate * t) * away / (one - other) for rate in (one, other)]
        end = one * waves[1] - other * waves[0]
        return rest + mpmath.re(end), mpmath.re(one * other * (waves[1] - waves[0]))


class Stored:
    """The references of one test module, a file of their own."""

    #: All of them, by name.
    known: dict = {}
    #: Whether everything is computed and kept, for `python -m tests.references`.
    recording = False

    def __init__(self, name):
        self.path = FOLDER / f"{name}.json"
        self.entries = json.loads(self.path.read_text("utf-8")) if self.path.exists() else {}
        self.recorded: dict = {}
        Stored.known[name] = self

    def propagate(self, *arguments):
        """Return (x, v, events), see `propagate`."""
        key = key_of(arguments)
        if Stored.recording:
            self.recorded[key] = texts(propagate(*arguments))
            return numbers(self.recorded[key])
        if key not in self.entries:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return propagate(*arguments)
        return numbers(self.entries[key])

    def rows(self, function, *arguments):
        """Return the rows of numbers, tuples, that a function of 50 digits returns."""
        key = key_of((function.__name__, *arguments))
        if Stored.recording:
            self.recorded[key] = row_texts(function(*arguments))
        known = self.recorded if Stored.recording else self.entries
        if key not in known:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return function(*arguments)
        return [tuple(map(mpmath.mpf, row.split())) for row in known[key]]

    def write(self):
        """Write what was recorded, one line for each reference."""
        lines = [f"{json.dumps(key)}: {json.dumps(self.recorded[key])}" for key in self.recorded]
        text = ",\n".join(sorted(lines))
        self.path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def key_of(arguments):
    """Return the key of a reference: a digest of the very floats."""
    return hashlib.sha256(repr(arguments).encode()).hexdigest()[:16]


def texts(motion):
    """Return (x, v, events) as texts."""
    x, v, events = motion
    rows = [f"{_text(at)} {before} {after} {_text(speed)}" for at, before, after, speed in events]
    return [f"{_text(x)} {_text(v)}", *rows]


def row_texts(rows):
    """Return rows of numbers as texts."""
    return [" ".join(map(_text, row)) for row in rows]


def _text(value):
    return mpmath.nstr(value, _DIGITS)


def numbers(rows):
    """Return (x, v, events) of texts."""
    (x, v), *events = (row.split() for row in rows)
    return (
        mpmath.mpf(x),
        mpmath.mpf(v),
        [(mpmath.mpf(a), int(b), int(c), mpmath.mpf(d)) for a, b, c, d in events],
    )

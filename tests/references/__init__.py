"""Compute reference values with 50 digits, and store those that take long.

Motions are computed by `tests.independent`. Files store 20 digits of the values. A value that is
not stored is computed with a warning, e.g. where another machine draws other random numbers.
`make references` renews the files; `test_references.py` recomputes some entries in each test run.
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
    """Return the motion of a pair over some mesh periods from a state (x, v) with 50 digits.

    The list contains the final state (x, v), followed by the events (phase, contact state before,
    contact state after, v).
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
    """Return the motion of a `GearPair` with 50 digits, see `propagate`."""
    names = ("contact_ratio", "stiffness_ratio", "damping_ratio", "backlash_damping_ratio")
    ratios = [getattr(pair, name) for name in (*names, "backlash_ratio")]
    return propagate(*ratios, tuning, periods, state)


def state_transition_matrix(decay, squared_frequency, t):
    """Return the transition matrix of (x, x') over the time t for x'' + 2 d x' + w^2 x = 0.

    Here d is `decay` and w^2 is `squared_frequency`, which may be zero.
    """
    root = mpmath.sqrt(mpmath.mpc(decay * decay - squared_frequency))
    cosh, sinh = mpmath.cosh(root * t), mpmath.sinh(root * t) / root if root else t
    rows = [[cosh + decay * sinh, sinh], [-squared_frequency * sinh, cosh - decay * sinh]]
    return (mpmath.matrix(rows) * mpmath.exp(-decay * t)).apply(mpmath.re)


def contact_map(contact_ratio, stiffness_ratio, damping, tuning):
    """Return the 2x2 map of (x, dx/dtau) over a mesh period without contact loss.

    The period starts at the middle of double tooth contact; tau is the mesh phase.
    """
    epsilon, kappa, beta, nu = map(
        mpmath.mpf, map(mpmath.mpmathify, (contact_ratio, stiffness_ratio, damping, tuning))
    )
    mean = kappa + (1 - kappa) * (epsilon - 1)
    half_duration = mpmath.pi * (epsilon - 1)  # half the phase of double contact
    half_double_contact = state_transition_matrix(beta / nu, 1 / mean / nu**2, half_duration)
    single_contact = state_transition_matrix(
        beta / nu, kappa / mean / nu**2, 2 * (mpmath.pi - half_duration)
    )
    return half_double_contact * single_contact * half_double_contact


def from_rest(decay, squared_frequency, load, x, t):
    """Return (x, x') at the time t for x'' + 2 d x' + w^2 x = load, from rest at x.

    Here d is `decay` and w^2 is `squared_frequency`, which may be zero.
    """
    with mpmath.workdps(50):
        decay, squared_frequency, load, x, t = map(
            mpmath.mpf, (decay, squared_frequency, load, x, t)
        )
        matrix = state_transition_matrix(decay, squared_frequency, t)
        if not squared_frequency:
            return x + load * (t - matrix[0, 1]) / (2 * decay), load * matrix[0, 1]
        equilibrium = load / squared_frequency
        x_relative = x - equilibrium
        return equilibrium + matrix[0, 0] * x_relative, matrix[1, 0] * x_relative


class StoredReferences:
    """The stored reference values of one test module, which has its own file."""

    #: All instances, one per test module.
    instances: list = []
    #: Whether values are computed and recorded, as in `python -m tests.references`.
    recording = False

    def __init__(self, name):
        """Read the stored values of the file `name`.json, if it exists."""
        self.path = FOLDER / f"{name}.json"
        self.entries = json.loads(self.path.read_text("utf-8")) if self.path.exists() else {}
        self.recorded: dict = {}
        StoredReferences.instances.append(self)

    def rows(self, function, *arguments):
        """Return the rows of numbers of `function(*arguments)`, from the file if possible."""
        key = reference_key(function, *arguments)
        if StoredReferences.recording:
            self.recorded[key] = number_strings(function(*arguments))
        stored_rows = self.recorded if StoredReferences.recording else self.entries
        if key not in stored_rows:
            warnings.warn(f"{self.path.name} lacks {arguments}: make references", stacklevel=2)
            return function(*arguments)
        return [tuple(map(mpmath.mpf, row.split())) for row in stored_rows[key]]

    def write(self):
        """Write the recorded values to the file, one line per call of a function."""
        lines = [f"{json.dumps(key)}: {json.dumps(self.recorded[key])}" for key in self.recorded]
        text = ",\n".join(sorted(lines))
        self.path.write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def reference_key(function, *arguments):
    """Return the key of a stored value: a hash of the function name and the exact arguments."""
    return hashlib.sha256(repr((function.__name__, *arguments)).encode()).hexdigest()[:16]


def number_strings(rows):
    """Return each row of numbers as a string with 20 digits per number."""
    return [" ".join(mpmath.nstr(value, _DIGITS) for value in row) for row in rows]

"""The reducer against the second program, and a range of a train.

``GEARLIB_CERTIFICATES=1`` follows a deviation of the reducer too.
"""

import os

import mpmath
import numpy as np

import gearlib
from gearlib.studies import certificates
from tests.independent.certificates import Motion
from tests.paper import PAPER
from tests.proofs.test_train_certificates import LIGHT, claim

#: Whether what takes many seconds is run as well.
LONG = "GEARLIB_CERTIFICATES" in os.environ


def test_the_symmetry_of_the_reducer_breaks():
    """Six meshes in contact; the second program follows the orbit, and a deviation beside it."""
    pair = PAPER.replace(material_damping=3953.7)
    train = gearlib.split_power_reducer(pair, teeth=certificates.REDUCER_TEETH)
    static, tuning = train.start_state("static"), certificates.REDUCER_TUNINGS[1]
    orbit = gearlib.periodic_orbit(train, tuning, guess=static, period=train.repeats)
    proven = gearlib.certify(orbit)
    assert proven.contacts == (1,) * 6 and not proven.events and proven.stability == "unstable"
    real, imaginary = proven.multipliers[0]
    assert real.high < -1 and imaginary.low == imaginary.high == 0
    # Of the map in floats the vector of this multiplier, of one branch against the others.
    _, maps, _ = train.propagator(tuning).maps(orbit.state, train.repeats, 10_000)
    reduce, lift = train.reduction()
    whole = reduce @ np.linalg.multi_dot(maps[::-1]) @ lift
    values, vectors = np.linalg.eig(whole)
    vector = (lift @ vectors[:, np.abs(values - float(real)).argmin()]).real
    motion = Motion(claim(proven))
    end, events = motion.run(motion.middle)
    assert max(abs(end - motion.middle)) < 1e-29 and not events
    if LONG:
        deviation = motion.reduced(list(map(mpmath.mpf, vector)))
        moved = motion.deviation(end, motion.middle, deviation) - float(real) * deviation
        assert max(abs(moved)) < 1e-9 * max(abs(deviation))


def test_a_range_of_a_train():
    orbit = gearlib.periodic_orbit(gearlib.idler(LIGHT), 0.7)
    assert set(orbit.pattern) == {1}
    proven = gearlib.certify_range(orbit, to=0.701)
    assert proven and proven.stability == "stable" and proven.train.contacts == (1, 1)

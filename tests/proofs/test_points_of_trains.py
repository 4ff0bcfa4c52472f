"""Special points, ranges and motions of trains, and the reducer: against the second program.

``GEARLIB_CERTIFICATES=1`` follows a deviation of the reducer too.
"""

import os
from functools import cache

import mpmath
import numpy as np
import pytest

import gearlib
from gearlib.studies import certificates_of_trains
from tests.paper import PAPER
from tests.proofs.checker import faults
from tests.proofs.test_train_certificates import LIGHT, claim
from tests.proofs.trains_in_50_digits import Motion

#: Whether what takes many seconds is run as well.
LONG = "GEARLIB_CERTIFICATES" in os.environ


@cache
def points():
    """The grazing and the fold of an idler between unequal gears, as `results` have them."""
    pair = PAPER.replace(material_damping=3953.7)
    given = certificates_of_trains.idler_points(pair, lambda branch: branch)
    return {found.kind: found for _, _, found in given}


@pytest.mark.parametrize("kind", ["grazing", "fold"])
def test_a_special_point_of_a_train_is_confirmed(kind):
    given = claim(points()[kind])
    assert faults(given) == []
    # And what is wrong is seen: another tuning, another state, a contact left out, another kind.
    nudged = [end[:-12] + "123456789012" for end in given["tuning"]]
    assert "orbit" in faults(given | {"tuning": nudged})
    moved = [[str(mpmath.mpf(end) + 1e-15) for end in box] for box in given["displacement"]]
    assert "orbit" in faults(given | {"displacement": moved})
    if kind == "fold":
        assert faults(given | {"claim": "period doubling"}) == ["multiplier"]
        assert faults(given | {"events": given["events"][:-1]}) == ["contacts"]
    else:
        assert faults(given | {"touched": ["pinion-idler", "coast"]}) == ["touch"]
        assert faults(given | {"touch": ["1.0", "1.1"]}) == ["touch"]


def test_the_symmetry_of_the_reducer_breaks():
    """Six meshes in contact; the second program follows the orbit, and a deviation beside it."""
    pair = PAPER.replace(material_damping=3953.7)
    train = gearlib.split_power_reducer(pair, teeth=certificates_of_trains.REDUCER)
    static, tuning = train.start_state("static"), certificates_of_trains.ALIKE[1]
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
    end, events, _ = motion.run(motion.middle)
    assert max(abs(end - motion.middle)) < 1e-29 and not events
    if LONG:
        deviation = motion.reduced(list(map(mpmath.mpf, vector)))
        moved = motion.deviation(end, motion.middle, deviation) - float(real) * deviation
        assert max(abs(moved)) < 1e-9 * max(abs(deviation))


def test_a_range_and_a_motion_of_a_train():
    orbit = gearlib.periodic_orbit(gearlib.idler(LIGHT), 0.7)
    assert set(orbit.pattern) == {1}
    proven = gearlib.certify_range(orbit, to=0.701)
    assert proven and proven.stability == "stable" and proven.train.contacts == (1, 1)
    start = orbit.state + 0.2
    found = gearlib.certify_motion(orbit, start, periods=40)
    assert found and len(found.arrival[0]) == len(start) // 2
    ends, codes = np.empty((1, start.size)), np.empty(1, np.int64)
    orbit.pair.propagator(0.7).skip(start[None], found.periods, 10_000, ends, codes)
    relative = ends[0] - [float(value) for half in found.arrival for value in half]
    reduce, _ = orbit.pair.reduction()
    assert np.abs(reduce @ relative).max() < 1e-11
    assert gearlib.certify_motion(orbit, start, periods=1).status == "arrival"

"""What drives six degrees of freedom: run-out, deviations, segments of stiffness and friction."""

import math

import numpy as np

from gearlib.models.stiffness import levels, segment_lengths


def waves_of(gears):
    """Return (frequencies, amplitudes) of run-out and the two deviations as cosine-sine pairs.

    Shapes (m,), (3, 2 m); amplitudes in static deflections.
    """
    unit = 1.0 / gears.pair.static_deflection
    e3, e2 = (e * unit for e in gears.eccentricities)
    z3, z2 = gears.teeth
    rows = {}

    def add(frequency, which, cosine, sine):
        entry = rows.setdefault(frequency, np.zeros((3, 2), np.result_type(unit, e3, e2)))
        entry[which] += (cosine, sine)

    if e3:
        add(1.0 / z3, 0, 0.0, e3)
    if e2:
        # -e2 sin(Delta - phi) = e2 (cos Delta sin phi - sin Delta cos phi)
        delta = gears.run_out_phase
        add(1.0 / z2, 0, -e2 * math.sin(delta), e2 * math.cos(delta))
    for which, deviation in ((1, gears.deviation), (2, gears.inverse_deviation)):
        for order, cosine, sine in deviation.table():
            add(order, which, cosine * unit, sine * unit)
    frequencies = np.array(sorted(rows))
    amplitudes = np.array([rows[f] for f in frequencies]).reshape(-1, 3, 2)
    return frequencies, amplitudes.transpose(1, 0, 2).reshape(3, -1)


def segments_of(gears):
    """Return (starts, stiffness, low, friction sense) of the segments of one period."""
    pair = gears.pair
    high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
    half_high, whole_low = segment_lengths(pair.contact_ratio.real)
    cuts = {0.0, half_high, half_high + whole_low}
    if any(gears.friction):
        turn = gears.pitch_phase % (2.0 * math.pi)
        cuts |= {turn, (turn + math.pi) % (2.0 * math.pi)}
    starts = np.array(sorted(c for c in cuts if c < 2.0 * math.pi) + [2.0 * math.pi])
    starts = starts[np.concatenate([[True], np.diff(starts) > 1e-14])]
    starts[-1] = 2.0 * math.pi
    middle = (starts[:-1] + starts[1:]) / 2.0
    is_low = (middle > half_high) & (middle < half_high + whole_low)
    after = np.mod(middle - gears.pitch_phase, 2.0 * math.pi)
    sense = np.where(after < math.pi, 1.0, -1.0)
    return starts, np.where(is_low, low, high), is_low, sense

"""What the steps of a motion of `reference_motion` leave behind: extrema, times, samples."""

from itertools import pairwise

import numpy as np

from tests.references.polynomial_zeros import product, slope_of, value_at, zeros


class Record:
    """Of the last periods: extrema and times of each contact; and samples, at phases asked for."""

    def __init__(self, count, phases):
        #: phases still to come; rows of (phase, distances, their rates, forces,
        #: coordinates), in units
        self.phases, self.samples = list(phases), []
        self.heights = [[] for _ in range(count)]
        self.forces = [[] for _ in range(count)]
        #: normal, backlash, inverse, in mesh at the lower stiffness
        self.times = [[0, 0, 0, 0] for _ in range(count)]


def _elastic(step, contact, code):
    """Return the coefficients of the elastic force of a contact that touches."""
    side = contact.drive if code > 0 else contact.coast
    g = step.distance(side)
    c, count = step.level(contact, side, len(g)), len(g)
    if any(contact.powers):
        square = [product(g, g, k) for k in range(count)]
        cube = [product(square, g, k) for k in range(count)]
        p2, p3 = contact.powers
        g = g + p2 * code * np.array(square) + p3 * np.array(cube)
    return np.array([product(c, g, k) for k in range(count)], g.dtype)


def note(step, record, t, codes):
    """Take extrema and times of a step."""
    machine = step.machine
    for j, (contact, code) in enumerate(zip(machine.contacts, codes, strict=True)):
        curves = [step.distance(contact.drive)]
        curves[0][0] -= contact.drive.constant if machine.n == 1 else 0
        if code:
            curves.append(_elastic(step, contact, code))
            # Of one degree that of the near side is asked for.
            side = contact.coast if code < 0 and machine.n > 1 else contact.drive
            level = np.array(step.level(contact, side, step.terms)) + 0 * t
            level[0] -= side.course.high
            floor = side.course.high * machine.tiny
            cuts = [0 * t, *zeros(level, t * 0, t, t * 1e-12, floor), t]
            for a, b in pairwise(cuts):
                record.times[j][3] += b - a if value_at(level, (a + b) / 2) < -floor else 0
        else:
            record.forces[j].append(0 * curves[0][0])
        for into, curve in zip((record.heights, record.forces), curves, strict=False):
            floor = machine.tiny * max(np.abs(curve))
            turns = [t * 0, *zeros(slope_of(curve), t * 0, t, t * 1e-12, floor), t]
            into[j] += [value_at(curve, place) for place in turns]
        record.times[j][1 - code] += t


def sample(step, phase):
    """Return (phase, distances, rates, forces, coordinates) of a place in a step, in units."""
    machine, t, rows = step.machine, phase - step.tau, []
    force = machine.length * machine.force_unit
    for contact, code in zip(machine.contacts, step.codes, strict=True):
        drive = step.distance(contact.drive)
        if machine.n == 1:
            drive[0] -= contact.drive.constant
        value = value_at(_elastic(step, contact, code), t) if code else 0
        rate = value_at(slope_of(drive), t)
        rows.append((value_at(drive, t) / machine.length, rate / machine.length, value / force))
    return (phase, *zip(*rows, strict=True), value_at(step.series, t) / machine.length)

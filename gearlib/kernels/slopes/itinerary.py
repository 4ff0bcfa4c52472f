"""The arcs, crossings and switches of a motion with its meshes' contacts, one after the other."""

from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import kernel

#: What a step of an itinerary is.
ARC, CROSSING, SWITCH, PERIOD = range(4)
#: Columns of a step: what it is, mesh, contact code before and after, segment before and after.
KIND, MESH, FROM, TO, LEFT, MET = range(6)
COLUMNS = 6


class Places(NamedTuple):
    """Where the stiffness of m meshes switches, p segments."""

    effect: np.ndarray  #: int, which matrix a mesh brings: by code + 1, segment, mesh (3, p, m)
    low: np.ndarray  #: bool, whether at its lower stiffness, the same shape
    starts: np.ndarray  #: phases that bound segments, shape (p + 1,)
    first: np.ndarray  #: int, where mesh periods begin, shape (repeats + 1,)


@kernel
def _add(steps, times, contacts, found, codes, own):
    for j in range(codes.shape[0]):
        contacts[found, 0, j], contacts[found, 1, j] = codes[j], own[j]
    steps[found, :], times[found, :] = 0, 0.0
    return found + 1


@kernel
def itinerary(places, codes, own, events, periods, steps, times, contacts):
    """Fill the steps of a motion.

    Parameters
    ----------
    places : Places
    codes, own : ndarray of int, shape (m,)
        Contact codes and segments at the start; changed in place to the end.
    events : ndarray, shape (e, 6)
    periods : int
    steps, times, contacts : ndarray, shapes (r, COLUMNS), (r, 2), (r, 2, m)
        Filled with the steps, with phase and length of arcs, with 1 and 0 of switches, see
        `through_arcs.walk`, and with codes and segments just before each step.

    Returns
    -------
    int
        How many steps there are.
    """
    m, found, event = codes.shape[0], 0, 0
    repeats = places.first.shape[0] - 1
    for i in range(periods):
        p, last = places.first[i % repeats], places.first[i % repeats + 1]
        begin, t = places.starts[p], 0.0
        row = _add(steps, times, contacts, found, codes, own)
        steps[found, KIND], steps[found, MESH], found = PERIOD, i, row
        while True:
            here = event < events.shape[0] and events[event, orbit.EVENT_PERIOD] == i
            cut = places.starts[p] - begin
            crosses = here and events[event, orbit.EVENT_PHASE] < cut
            end = events[event, orbit.EVENT_PHASE] if crosses else cut
            if here and not crosses and p == last:
                crosses = True
            if end > t:
                row = _add(steps, times, contacts, found, codes, own)
                times[found, 0], times[found, 1], found = t, end - t, row
                t = end
            if crosses:
                j = int(events[event, orbit.EVENT_COLUMNS])
                row = _add(steps, times, contacts, found, codes, own)
                steps[found, KIND], steps[found, MESH] = CROSSING, j
                steps[found, FROM] = codes[j]
                steps[found, TO] = int(events[event, orbit.EVENT_TO])
                steps[found, LEFT] = steps[found, MET] = own[j]
                codes[j], event, found = steps[found, TO], event + 1, row
            elif p < last:
                for j in range(m):
                    code, old = codes[j] + 1, own[j]
                    if old != p and code != BACKLASH + 1:
                        # Of friction too, which turns with the sliding.
                        if places.effect[code, old, j] != places.effect[code, p, j]:
                            row = _add(steps, times, contacts, found, codes, own)
                            steps[found, KIND], steps[found, MESH] = SWITCH, j
                            steps[found, FROM] = steps[found, TO] = codes[j]
                            steps[found, LEFT], steps[found, MET] = old, p
                            times[found, 0], found = 1.0, row
                own[:], p = p, p + 1
            else:
                break
    return found

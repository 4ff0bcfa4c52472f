"""What a run of a gear train is divided into, and its storage."""

from typing import NamedTuple

import numpy as np

from gearlib.engines.linear.modal_arcs import DEGREE
from gearlib.engines.linear.sparse_series import price_of, sparse_of
from gearlib.engines.linear.train_system import may_close
from gearlib.engines.polynomial import WORK_ROWS, bernstein_matrix

# Entries of `Work.place`: events recorded so far, mesh period, segment (-1: at the start of a
# period), events of the period, samples taken of it, events before it, mesh periods that the
# segments of the system last for.
FOUND, PERIOD, SEGMENT, COUNT, TAKEN, OPENING, UNTIL = range(7)


class Grid(NamedTuple):
    """What the meshes of a system and its segments are like."""

    length: np.ndarray  #: theta of the segments, shape (p,)
    kind: np.ndarray  #: int, number of that length, -1: it comes once, shape (p,)
    rate: np.ndarray  #: functionals of dd_j/dtheta, shape (m, n)
    far_rate: np.ndarray  #: of the distances from the coast side
    open: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    closing: np.ndarray  #: bool, whether both of its flanks might touch at once, shape (m,)
    plain: np.ndarray  #: bool, whether its flanks are a constant apart, shape (m,)
    gap: np.ndarray  #: bool, whether there is a backlash between them, shape (m,)
    spin: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)
    block: np.ndarray  #: int, which rows of a summary each mesh period is in, shape (repeats,)
    taken: np.ndarray  #: int, where samples of mesh periods begin, shape (repeats + 1,) or (0,)
    columns: np.ndarray  #: int, of what is not zero in `free`, see `sparse_series.sparse_of`
    count: np.ndarray
    values: np.ndarray
    places: np.ndarray  #: int, of the components that a mesh touches
    touched: np.ndarray
    chirp: np.ndarray  #: frequencies by tau of harmonics on a course of speed, shape (h,)
    pace: int  #: the component that is dtau/dtheta there, see `sparse_series`


class Work(NamedTuple):
    """What changes on the way, and storage."""

    contact: np.ndarray  #: int, contact codes, shape (m,)
    rest: np.ndarray  #: int, leading coefficients that are 0: 1 on a line, more: at rest, (m,)
    line: np.ndarray  #: int, on which: 1 drive side, -1 coast side, shape (m,)
    effects: np.ndarray  #: int, shape (m,)
    clear: np.ndarray  #: bool, whether a mesh comes to no flank line, shape (m,)
    share: np.ndarray  #: where a mesh has its event, in shares of a piece, shape (m,)
    target: np.ndarray  #: int, its contact after that, shape (m,)
    spread: np.ndarray  #: rounding of that share, shape (m,)
    z: np.ndarray  #: the state, filled up
    y: np.ndarray  #: the same in modes
    other: np.ndarray
    sampled: np.ndarray
    moved: np.ndarray
    term: np.ndarray
    image: np.ndarray
    factors: np.ndarray
    sizes: np.ndarray  #: of the modes
    place: np.ndarray  #: int, how far the run is, by the names above, shape (7,)
    ahead: np.ndarray  #: theta left of the segment, phase of the last event
    curve: np.ndarray  #: Bernstein coefficients of a distance, shape (degree + 1,)
    bernstein: np.ndarray  #: those of intervals that wait, and their widths
    terms: np.ndarray  #: the series of the state, shape (degree + 1, filled up)
    distances: np.ndarray  #: its distances, far and near, shape (2, m, degree + 2)
    powers: np.ndarray  #: from powers to Bernstein coefficients, shape (degree + 1, degree + 1)


def grid_of(system):
    """Return the `Grid` of a system; how many lengths it has is ``kind.max() + 1``."""
    length = np.diff(system.starts) / system.tuning
    # Lengths that differ by rounding are one.
    order = np.argsort(length, kind="stable")
    new = np.concatenate([[True], np.diff(length[order]) > 1e-13 * length[order][1:]])
    kind = np.empty(length.size, np.int64)
    kind[order] = np.cumsum(new) - 1
    length = length[order][new][kind]
    one = system.free.shape[0] - 1 - 2 * system.harmonics.size
    never = ~system.far[:, :one].any(axis=1)
    apart = system.far - system.near
    plain = ~(apart[:, :one].any(axis=1) | apart[:, one + 1 :].any(axis=1))
    near, far = system.near @ system.free, system.far @ system.free
    closing = ~never & may_close(system.near, system.far, one)
    spin = system.harmonics * system.tuning
    gap = ~plain | (apart[:, one] != 0.0)
    block = np.zeros(len(system.first_segment) - 1, np.int64)
    own = near, far, never, closing, plain, gap, spin, block, np.empty(0, np.int64)
    return Grid(length, kind, *own, **sparse_of(system), chirp=np.empty(0), pace=0)


def work_of(n, wide, m, degree=DEGREE, wanted=False):
    """Return `Work` for n components, filled up to `wide`, m meshes and polynomials.

    With what the series takes where modes may cost more, or where it is `wanted`.
    """
    series = wanted or price_of(n) > 0
    terms = np.zeros((degree + 1 if series else 0, wide))
    distances = np.zeros((2, m, degree + 2 if series else 0))
    integers = (np.zeros(m, np.int64) for _ in range(4))
    states = (np.zeros(wide) for _ in range(7))
    place, ahead = np.array([0, 0, -1, 0, 0, 0, 0]), np.zeros(2)
    storage = np.zeros(degree + 1), np.zeros((WORK_ROWS, degree + 2)), terms, distances
    events = np.zeros(m, np.bool_), np.zeros(m), np.zeros(m, np.int64), np.zeros(m)
    sizes, powers = (np.zeros(n), np.zeros(n)), bernstein_matrix(degree if series else 0)
    return Work(*integers, *events, *states, *sizes, place, ahead, *storage, powers)

"""What a run of a gear train is divided into, and its room to compute."""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.system import ORDER, may_close
from gearlib.kernels.several_meshes.combinations import BEHIND, LOOK, filled_up


class Grid(NamedTuple):
    """How the mesh periods of a system are divided."""

    substeps: np.ndarray  #: int, substeps of every segment, shape (p,)
    length: np.ndarray  #: theta of such a substep, shape (p,)
    kind: np.ndarray  #: int, number of that length, shape (p,)
    rate: np.ndarray  #: functionals of dd_j/dtheta, shape (m, n)
    far_rate: np.ndarray  #: of the distances from the coast side
    open: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    closing: np.ndarray  #: bool, whether both of its flanks might touch at once, shape (m,)
    apart: np.ndarray  #: rows of far - near by constant and harmonics, (m, ORDER + 1, 1 + 2 h)
    spin: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)


class Work(NamedTuple):
    """What changes on the way, and room to compute."""

    contact: np.ndarray  #: int, contact codes, shape (m,)
    rest: (
        np.ndarray
    )  #: int, leading coefficients that are 0: 1 on a line, more: at rest on it, (m,)
    line: np.ndarray  #: int, on which: 1 drive side, -1 coast side, shape (m,)
    effects: np.ndarray  #: int, shape (m,)
    clear: np.ndarray  #: bool, whether a mesh comes to no flank line, shape (m,)
    share: np.ndarray  #: where a mesh has its event, in shares of what is left, shape (m,)
    target: np.ndarray  #: int, its contact after that, shape (m,)
    spread: np.ndarray  #: rounding of that share, shape (m,)
    z: np.ndarray  #: the state, filled up
    other: np.ndarray
    term: np.ndarray
    image: np.ndarray
    found: np.ndarray  #: int, events recorded so far, shape (1,)
    look: np.ndarray  #: shape (LOOK m,)
    tail: np.ndarray
    behind: np.ndarray
    curve: np.ndarray  #: shape (ORDER + 1,)
    scaled: np.ndarray  #: shape (ORDER + 1,)
    bernstein: np.ndarray


def grid_of(system):
    """Return the `Grid` of a system; how many lengths it has is ``kind.max() + 1``."""
    spans = np.diff(system.starts) / system.tuning
    substeps = np.maximum(np.ceil(spans / system.longest * (1.0 - 1e-12)), 1.0).astype(np.int64)
    length = spans / substeps
    # Lengths that differ by rounding are one.
    order = np.argsort(length, kind="stable")
    new = np.concatenate([[True], np.diff(length[order]) > 1e-13 * length[order][1:]])
    kind = np.empty(length.size, np.int64)
    kind[order] = np.cumsum(new) - 1
    length = length[order][new][kind]
    n, h = system.free.shape[0], system.harmonics.size
    one = n - 1 - 2 * h
    apart = np.zeros((len(system.near), ORDER + 1, 1 + 2 * h))
    rows = (system.far - system.near)[:, one:]
    waves = system.free[one:, one:]
    for k in range(ORDER + 1):
        apart[:, k] = rows
        rows = rows @ waves * (system.longest / (k + 1))
    never = ~system.far[:, :one].any(axis=1)
    spin = system.harmonics * system.tuning
    near, far = system.near @ system.free, system.far @ system.free
    closing = ~never & may_close(system.near, system.far, one)
    return Grid(substeps, length, kind, near, far, never, closing, apart, spin)


@kernel
def work_of(n, m):
    """Return `Work` for n components and m meshes."""
    wide = filled_up(n)
    return Work(
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.int64),
        np.zeros(m, np.bool_),
        np.empty(m),
        np.zeros(m, np.int64),
        np.empty(m),
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(wide),
        np.zeros(1, np.int64),
        np.empty(LOOK * m),
        np.empty(filled_up(m)),
        np.empty(BEHIND),
        np.empty(ORDER + 1),
        np.empty(ORDER + 1),
        np.empty((50, ORDER + 2)),
    )

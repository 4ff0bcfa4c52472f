"""The planetary train of the trial beside its yardstick in C++, where a compiler is.

Whole calls of few and of many periods, in turns, the least of several rounds: of the many the
tables hardly count. The yardstick gives the state at the end, ours the summary as well.
"""

import subprocess
import tempfile
import time

import numpy as np

from benchmarks.from_rest import built
from benchmarks.short import repeats

ROUNDS = repeats(5)
#: Mesh periods of the calls.
PERIODS = (400, 4000)


def coordinates(train):
    """Return (to, of): displacements of coordinates where the mass is 1, without the free rotation.

    Shapes (N - 1, N) and (N, N - 1), in m.
    """
    mass = train.structure.mass
    free = train.free_motions.T @ mass
    of = np.linalg.svd(free)[2][len(free) :].T
    of = of @ np.linalg.inv(np.linalg.cholesky(of.T @ mass @ of)).T
    return of.T @ mass, of


def numbers(train, frequency, state, periods):
    """Return what the yardstick reads; `state` as of `GearTrain.start_state`."""
    s, (to, of), meshes = train.structure, coordinates(train), train.meshes
    lines = s.mesh_jacobian @ of
    film = np.array([mesh.backlash_damping for mesh in meshes])
    upper = np.array([mesh.max_stiffness for mesh in meshes])
    q, v = np.reshape(state, (2, -1)) * float(train.static_deflection)
    parts = (
        [frequency, periods, ROUNDS],
        of.T @ s.stiffness @ of,
        of.T @ s.damping @ of + (lines.T * film) @ lines,
        of.T @ s.load,
        lines,
        upper,
        upper * [mesh.stiffness_ratio for mesh in meshes],
        [mesh.contact_ratio for mesh in meshes],
        [train.phases[mesh.name] for mesh in meshes],
        [mesh.material_damping - mesh.backlash_damping for mesh in meshes],
        [mesh.backlash for mesh in meshes],
        to @ q,
        to @ v * (2.0 * np.pi * frequency),
    )
    return "\n".join(repr(float(x)) for part in parts for x in np.ravel(part))


def by_yardstick(program, train, frequency, state, periods):
    """Return (seconds, seconds with tables there, final state as of `GearTrain.start_state`)."""
    words = numbers(train, frequency, state, periods)
    done = subprocess.run([program], input=words, text=True, check=True, capture_output=True)
    whole, march, *end = map(float, done.stdout.split())
    q, v = np.reshape(end, (2, -1)) @ coordinates(train)[1].T / float(train.static_deflection)
    return whole, march, np.concatenate([q, v / (2.0 * np.pi * frequency)])


def rows(train, cases, run):
    """Return rows (name, value, unit).

    Parameters
    ----------
    train : GearTrain
        With three planets.
    cases : sequence
        Of (name, mesh frequency in Hz, tuning, state).
    run : callable
        ``run(train, tuning, state, periods)`` returns (final state, ...) without free rotation.
    """
    table, without = [], train.reduction()[0]
    with tempfile.TemporaryDirectory() as folder:
        program = built(folder, "yardstick_train")
        for name, frequency, tuning, state in cases if program is not None else ():
            for periods in PERIODS:
                ours = theirs = march = np.inf
                for _ in range(ROUNDS):
                    start = time.process_time()
                    expected = run(train, tuning, tuple(state), periods)[0]
                    ours = min(ours, time.process_time() - start)
                    found = by_yardstick(program, train, frequency, state, periods)
                    theirs, march = min(theirs, found[0]), min(march, found[1])
                apart = np.abs(without @ found[2] - expected).max()
                unit = "us per mesh period"
                table += [
                    (f"{name}, {periods} periods", ours / periods * 1e6, unit),
                    ("  yardstick in C++, the final state", theirs / periods * 1e6, unit),
                    ("  that with tables that are there", march / periods * 1e6, unit),
                    ("  ours to C++", ours / theirs, "times"),
                    ("  largest difference of final states", apart, ""),
                ]
    return table

"""Before several workers start: the machine code that more than one of them needs."""


def pytest_sessionstart(session):
    """Run each family of kernels once; from the cache this takes a second or two.

    Workers that compile at the same time would do the same work twice, into the same files.
    """
    config = session.config
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        _warm_up()


def _warm_up():
    from gearlib import Harmonics, OneDegreePair, SixDegreePair, kernels, simulate
    from tests.paper import PAPER

    kernels.warm_up()
    run = {"periods": 2, "record_periods": 1}
    simulate(OneDegreePair(pair=PAPER, deviation=Harmonics((1e-6,))), 0.9, **run)
    simulate(OneDegreePair(pair=PAPER, cubic_damping=4e5), 0.9, **run)
    gears = SixDegreePair(
        pair=PAPER,
        base_radii=(0.1, 0.1),
        inertias=(0.1, 0.1),
        masses=(17.0, 17.0),
        bearing_stiffness=(1e7,) * 4,
        bearing_damping=(500.0,) * 4,
    )
    simulate(gears, 0.9, **run)
    for method in ("rk4", "rk45"):
        simulate(PAPER, 0.9, method=method, **run)

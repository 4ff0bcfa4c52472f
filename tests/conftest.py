"""One cache of machine code for all test processes, filled before several workers start."""

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# Copies of the project and processes that tests start share the machine code of this checkout.
SHARED = str(Path(__file__).with_name("shared_cache"))
os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = "shared_cache.SharedLocator"
if SHARED not in sys.path:
    sys.path.append(SHARED)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.getenv("PYTHONPATH"), SHARED]))

RUN = {"periods": 2, "record_periods": 1}


def pytest_sessionstart(session):
    """Run each family of kernels once, side by side; from the cache this takes seconds.

    Workers that compile at the same time would do the same work twice, into the same files.
    """
    config = session.config
    processes = getattr(config.option, "numprocesses", None)
    if processes and not hasattr(config, "workerinput") and not os.environ.get("NUMBA_DISABLE_JIT"):
        spawned = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(processes, len(FAMILIES)), mp_context=spawned) as pool:
            for done in [pool.submit(warm_up) for warm_up in FAMILIES]:
                done.result()


def _matrices():
    """Run the kernels of trains."""
    from gearlib import planetary, simulate

    simulate(planetary(stiffness_ratio=(0.8, 0.8)), 1.0, **RUN)


def _pair():
    """Run the kernels of gear pairs."""
    from gearlib import engines

    engines.warm_up()


def _taylor():
    """Run the kernels of Taylor steps."""
    from gearlib import OneDegreePair, simulate
    from tests.paper import PAPER_PAIR

    simulate(OneDegreePair(pair=PAPER_PAIR, cubic_damping=4e5), 0.9, **RUN)


def _steps():
    """Run the kernels of step methods."""
    from gearlib import simulate
    from tests.paper import PAPER_PAIR

    for method in ("rk4", "rk45"):
        simulate(PAPER_PAIR, 0.9, method=method, **RUN)


#: Groups of kernels that are compiled independently, the longest first.
FAMILIES = (_matrices, _pair, _taylor, _steps)

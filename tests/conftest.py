"""Let all test processes share one cache of compiled kernels, filled before the workers start."""

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# Copies of the project and processes that tests start share the machine code of this checkout.
CACHE_LOCATOR_FOLDER = str(Path(__file__).with_name("shared_cache"))
os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = "shared_cache.SharedLocator"
if CACHE_LOCATOR_FOLDER not in sys.path:
    sys.path.append(CACHE_LOCATOR_FOLDER)
    os.environ["PYTHONPATH"] = os.pathsep.join(
        filter(None, [os.getenv("PYTHONPATH"), CACHE_LOCATOR_FOLDER])
    )

SHORT_RUN = {"periods": 2, "record_periods": 1}


def pytest_sessionstart(session):
    """Compile all kernels once before pytest-xdist starts its workers.

    Otherwise, several workers would compile the same kernels and write the same cache files. If
    the kernels are in the cache already, this takes seconds.
    """
    config = session.config
    worker_count = getattr(config.option, "numprocesses", None)
    is_worker = hasattr(config, "workerinput")
    if not worker_count or is_worker or os.environ.get("NUMBA_DISABLE_JIT"):
        return
    spawn_context = multiprocessing.get_context("spawn")
    process_count = min(worker_count, len(KERNEL_GROUPS))
    with ProcessPoolExecutor(process_count, mp_context=spawn_context) as pool:
        futures = [pool.submit(run_kernels) for run_kernels in KERNEL_GROUPS]
        for future in futures:
            future.result()


def _run_train_kernels():
    """Run the kernels of trains."""
    from gearlib import planetary, simulate

    simulate(planetary(stiffness_ratio=(0.8, 0.8)), 1.0, **SHORT_RUN)


def _run_gear_pair_kernels():
    """Run the kernels of gear pairs."""
    from gearlib import engines

    engines.warm_up()


def _run_taylor_kernels():
    """Run the kernels of Taylor steps."""
    from gearlib import OneDegreePair, simulate
    from tests.paper import PAPER_PAIR

    simulate(OneDegreePair(pair=PAPER_PAIR, cubic_damping=4e5), 0.9, **SHORT_RUN)


def _run_step_method_kernels():
    """Run the kernels of step methods."""
    from gearlib import simulate
    from tests.paper import PAPER_PAIR

    for method in ("rk4", "rk45"):
        simulate(PAPER_PAIR, 0.9, method=method, **SHORT_RUN)


#: Groups of kernels that are compiled independently, the longest first.
KERNEL_GROUPS = (
    _run_train_kernels,
    _run_gear_pair_kernels,
    _run_taylor_kernels,
    _run_step_method_kernels,
)

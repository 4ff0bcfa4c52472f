"""A plugin of pytest that records, with coverage running, which tests reach a line, and their time.

``MUTANTS_SECONDS`` is the longest that a test may take; ``MUTANTS_FOLDER`` gets the times, and its
``only.json`` names the tests that count, where not all do.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

import coverage
import pytest

_LONGEST = float(os.environ["MUTANTS_SECONDS"])
_folder = Path(os.environ["MUTANTS_FOLDER"])
_times: dict = {}
_failed: set = set()
_alone: dict = {}
#: Seconds that it takes to plan a single figure.
_SNAKEMAKE = 3.0


class _TooLong(BaseException):
    pass


def _stop(number, frame):
    raise _TooLong


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    """Give what runs from here the name of the test."""
    running = coverage.Coverage.current()
    running.switch_context(item.nodeid)
    # And what it starts as other processes: coverage hands them its settings.
    running.config.context = item.nodeid
    os.environ["COVERAGE_PROCESS_CONFIG"] = running.config.serialize()
    yield
    running.switch_context("")


def pytest_collection_modifyitems(items):
    """Keep the tests that count."""
    only = set(json.loads((_folder / "only.json").read_text(encoding="utf-8")))
    items[:] = [item for item in items if not only or item.nodeid in only]


def pytest_collection_finish(session):
    """Give each figure that one test draws for all its own test, which can also draw it alone."""
    redraw = sys.modules.get("tests.golden.redraw")
    if redraw is None:
        return
    draw = redraw._draw
    tests = [item.nodeid for item in session.items if "test_drawn" in item.nodeid]

    def one(given, params, output):
        start = time.monotonic()
        stem = Path(output[0]).stem
        mine = [name for name in tests if name.endswith(f"[{stem}]")]
        if mine:
            coverage.Coverage.current().switch_context(mine[0])
        draw(given, params, output)
        for name in mine:
            _alone[name] = time.monotonic() - start + _SNAKEMAKE

    redraw._draw = one


def _limited():
    """Run a part of a test for no longer than it may."""
    signal.signal(signal.SIGALRM, _stop)
    signal.setitimer(signal.ITIMER_REAL, _LONGEST)
    try:
        outcome = yield
        # Else it would end the session.
        if outcome.excinfo and issubclass(outcome.excinfo[0], _TooLong):
            outcome.force_exception(TimeoutError("longer than is allowed here"))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_setup(item):
    """Limit what a test asks for."""
    yield from _limited()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item):
    """Limit the test."""
    yield from _limited()


def pytest_runtest_logreport(report):
    """Add the seconds of one part of a test, in the process that ran it."""
    _times[report.nodeid] = _times.get(report.nodeid, 0.0) + report.duration
    if report.outcome != "passed":
        _failed.add(report.nodeid)


def pytest_sessionfinish(session):
    """Write them; what failed or was skipped notices nothing."""
    passed = {name: t for name, t in (_times | _alone).items() if name not in _failed}
    path = _folder / f"{os.getpid()}.seconds.json"
    path.write_text(json.dumps(passed), encoding="utf-8")
    # On a busy machine a worker is ended before it would do so itself.
    coverage.Coverage.current().save()

"""A process that has loaded others' packages and forks for each run: it costs its tests only.

Nothing of this project is loaded before the fork. It stands in a copy of the tree; an order is a
line of JSON, and so is the answer: pytest's status (None: out of time) and the test that failed.
"""

import importlib
import json
import os
import signal
import sys
import time

import hypothesis
import pytest

PACKAGES = """
bokeh.models bokeh.plotting click flint hypothesis matplotlib.pyplot mpmath netCDF4 numba numpy
pandas pint pydantic rich scipy.integrate scipy.linalg scipy.optimize scipy.signal scipy.sparse
scipy.special xarray yaml
"""


class _Chosen:
    """The tests to run, in their order; files are collected whole."""

    def __init__(self, tests):
        self.rank, self.failed = {name: i for i, name in enumerate(tests)}, ""

    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if item.nodeid in self.rank]
        items.sort(key=lambda item: self.rank[item.nodeid])

    def pytest_runtest_logreport(self, report):
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_collectreport(self, report):
        self.failed = self.failed or (report.nodeid if report.failed else "")


def _run(order, answer):
    """Run the tests of an order in a forked process, and do not return."""
    os.setsid()
    os.environ.update(order["environment"])
    if "NUMBA_DISABLE_JIT" in order["environment"]:
        sys.modules["numba"].config.DISABLE_JIT = 1
    with open(order["printed"], "w", encoding="utf-8") as output, open(os.devnull) as empty:
        os.dup2(empty.fileno(), 0)
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    # One example is enough to kill.
    only = hypothesis.Phase.explicit, hypothesis.Phase.generate
    hypothesis.settings.register_profile("mutants", phases=only, database=None)
    hypothesis.settings.load_profile("mutants")
    chosen = _Chosen(order["tests"])
    files = dict.fromkeys(name.partition("::")[0] for name in order["tests"])
    options = ["-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=short"]
    status = int(pytest.main([*options, *files], plugins=[chosen]))
    os.write(answer, json.dumps([status, chosen.failed]).encode())
    sys.stdout.flush()
    os._exit(0)


def main():
    """Answer orders until there are no more."""
    for name in PACKAGES.split():
        importlib.import_module(name)
    for line in sys.stdin:
        order = json.loads(line)
        read, write = os.pipe()
        child = os.fork()
        if not child:
            _run(order, write)
        os.close(write)
        deadline = time.monotonic() + order["seconds"]
        while not os.waitpid(child, os.WNOHANG)[0]:
            if time.monotonic() > deadline:
                os.killpg(child, signal.SIGKILL)
                os.waitpid(child, 0)
                break
            time.sleep(0.02)
        answer = os.read(read, 100_000)
        os.close(read)
        late = time.monotonic() > deadline
        # A process that died without a word was brought down by the mutation.
        print(json.dumps(json.loads(answer or ("null" if late else '[3, ""]'))), flush=True)


if __name__ == "__main__":
    main()

"""Mutants at random, each against the tests that reach its line: `make mutants`.

A seeded sample of each room, in copies of the tree. A mutant that no test notices is a survivor;
`verdicts.yaml` names those that were judged by hand. The run fails where one is not named, or
where fewer than 95 % of those that are not equal to the code are killed in a room.

A tool of one's own, because none that is kept up fits: mutmut wraps each function, which numba does
not compile and pydantic does not read, and leaves decorated ones out; cosmic-ray runs one command
for all mutants and swaps no arguments; neither samples by rooms nor chooses tests by line.
"""

import argparse
import compileall
import json
import os
import py_compile
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import yaml

from tests.faults.__main__ import copied
from tests.mutants.mutations import ROOMS, ROOT, sample
from tests.mutants.reach import KERNELS, PLAIN, reach

VERDICTS = Path(__file__).with_name("verdicts.yaml")
KEY = ("file", "where", "source", "mutated")
#: Seconds of the tests of a first round.
FIRST = 5.0
LEAST = 0.95
#: Rooms of which more than 20 mutants are taken.
_LARGER = ("analysis/proofs", "integrators", "studies/claims", "studies/trains", "workflow")
COUNTS = dict.fromkeys(_LARGER, 40)
#: They run all jobs of a small workflow and compare what these write.
FIRST_RUN = "tests/workflow/test_first_run.py"


class Worker:
    """A copy of the tree and the process that runs tests there."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.tree = copied(folder)
        # Known by the text, not by the time, so that a mutant is never taken for another; and who
        # compiles it again keeps to that.
        checked = py_compile.PycInvalidationMode.CHECKED_HASH
        for part in ("gearlib", "workflow"):
            compileall.compile_dir(self.tree / part, quiet=2, invalidation_mode=checked)
        threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
        more = {"PYTHONPATH": str(self.tree), "PYTHONDONTWRITEBYTECODE": "", "PYTEST_ADDOPTS": ""}
        self.server = subprocess.Popen(
            [sys.executable, "-m", "tests.mutants.worker"],
            cwd=self.tree,
            env=os.environ | more | dict.fromkeys(threads, "1"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, tests, environment):
        """Return pytest's status, None where it took too long, and the test that failed."""
        order = {
            "tests": [*tests],
            # With a cache of its own, kernels are compiled first.
            "seconds": 120.0
            + 480.0 * ("NUMBA_CACHE_DIR" in environment)
            + 6.0 * sum(tests.values()),
            "environment": environment,
            "printed": str(self.folder / "printed.txt"),
        }
        print(json.dumps(order), file=self.server.stdin, flush=True)
        return json.loads(self.server.stdout.readline()) or (None, "")

    def close(self):
        """End its process."""
        self.server.stdin.close()
        self.server.wait()


class Judge:
    """What becomes of a mutant, and which tests may say so: those that pass without one here."""

    def __init__(self, reached, most=150.0):
        self.reached, self.most, self.sound = reached, most, {}

    def verdict(self, one, worker):
        """Return "killed", "timeout" or "survived", and the test that noticed."""
        path = worker.tree / one.file
        text = path.read_text(encoding="utf-8")
        kernel = one.file.startswith(KERNELS)
        for tests, environment in self._rounds(one, kernel):
            tests = {name: t for name, t in tests.items() if self.sound.get(name, True)}
            while tests:
                path.write_text(one.planted(worker.tree), encoding="utf-8")
                try:
                    with tempfile.TemporaryDirectory() as cache:
                        own = {"NUMBA_CACHE_DIR": cache} if kernel and not environment else {}
                        status, failed = worker.run(tests, environment | own)
                finally:
                    path.write_text(text, encoding="utf-8")
                if status is None:
                    return "timeout", ""
                if status in (0, 5):
                    break
                # Where a whole file failed to load, one test of it loads it as well.
                test = failed if failed in tests else _quickest(tests, failed)
                if self._is_sound(test, tests[test], environment, worker):
                    return "killed", failed
                del tests[test]
        return "survived", ""

    def _is_sound(self, test, seconds, environment, worker):
        key = test, *environment
        if key not in self.sound:
            self.sound[key] = worker.run({test: seconds}, environment)[0] == 0
            if not self.sound[key]:
                print(f"not counted, it fails on the code as it is: {test}", flush=True)
        return self.sound[key]

    def _rounds(self, one, kernel):
        if kernel:
            yield from _split(self.reached.tests(one, "plain"), PLAIN, self.most / 4.0)
        near = self.reached.tests(one)
        yield from _split(near, {}, self.most)
        if not kernel:
            wide = self.reached.whole_files(near)
            rest = {name: wide[name] for name in wide if name not in near}
            yield from _split(rest, {}, self.most)
        if one.file.startswith("workflow/"):
            # What a script does in its job, however long that takes.
            yield self.reached.of(FIRST_RUN), {}


def _quickest(tests, path):
    ours = [name for name in tests if name.partition("::")[0] == path] or [*tests]
    return min(ours, key=tests.get)


def _split(tests, environment, most):
    """Yield the first tests, then the others, up to so many seconds in all."""
    parts, total, seen = ({}, {}), 0.0, set()
    for name in tests:
        # A file takes its time to load, too.
        file = name.partition("::")[0]
        total += tests[name] + (0.01 if file in seen else 0.3)
        seen.add(file)
        if total > most and parts[0]:
            break
        parts[total > FIRST][name] = tests[name]
    for part in parts:
        # File by file: what a file prepares is prepared once.
        files = [*dict.fromkeys(name.partition("::")[0] for name in part)]
        names = sorted(part, key=lambda name: files.index(name.partition("::")[0]))
        yield {name: part[name] for name in names}, environment


def verdicts():
    """Return what was judged by hand: key -> row of the list."""
    rows = yaml.safe_load(VERDICTS.read_text(encoding="utf-8")) or []
    return {tuple(row[key] for key in KEY): row for row in rows}


def table(results, named):
    """Return lines for each room, the survivors that nobody has named, and whether all is well."""
    lines = [f"{'room':26} mutants killed timeout named equal open  share"]
    survivors, well = [], True
    for room in dict.fromkeys(row["room"] for row in results):
        count = Counter()
        for row in results:
            if row["room"] == room:
                found = named.get(tuple(row[key] for key in KEY))
                survived = row["verdict"] == "survived"
                why = "open" if found is None else "equal" if found["why"] == "equal" else "named"
                count[why if survived else row["verdict"]] += 1
                if survived and found is None:
                    survivors.append(row)
        killed = count["killed"] + count["timeout"]
        share = killed / max(1, count.total() - count["equal"])
        well &= share >= LEAST and not count["open"]
        lines.append(
            f"{room:26} {count.total():7} {count['killed']:6} {count['timeout']:7}"
            f" {count['named']:5} {count['equal']:5} {count['open']:4} {share:6.1%}"
        )
    return lines, survivors, well


def main():
    """Run the sample."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("rooms", nargs="*", metavar="room", help="default: all rooms")
    parser.add_argument("--count", type=int, help="mutants of a room; default: 20, of some 40")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--part", default="", help="of files with this in their path")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=150.0, help="of tests for one mutant")
    parser.add_argument("--tests", nargs="*", default=[], help="files of tests; default: all")
    parser.add_argument("--resume", action="store_true", help="keep what was killed before")
    parser.add_argument("--folder", type=Path, default=ROOT / "build/mutants")
    given = parser.parse_args()
    rooms = given.rooms or sorted(set(ROOMS.values()))
    if unknown := set(rooms) - set(ROOMS.values()):
        parser.error(f"no such room: {', '.join(sorted(unknown))}")
    given.folder.mkdir(parents=True, exist_ok=True)
    kernels = any(room.startswith("kernels") for room in rooms)
    judge = Judge(
        reach(given.folder / "reach.json", given.tests, given.jobs, kernels), given.seconds
    )
    path = given.folder / "results.jsonl"
    old = path.read_text(encoding="utf-8") if given.resume and path.is_file() else ""
    killed = {tuple(row[key] for key in KEY): row for row in map(json.loads, old.splitlines())}
    waiting, results = queue.Queue(), []
    for room in rooms:
        for one in sample(room, given.count or COUNTS.get(room, 20), given.seed, part=given.part):
            if killed.get(one.key, {"verdict": "survived"})["verdict"] == "survived":
                waiting.put((room, one))
            else:
                results.append(killed[one.key])

    def work(folder):
        worker = Worker(folder)
        while True:
            try:
                room, one = waiting.get_nowait()
            except queue.Empty:
                return worker.close()
            start = time.monotonic()
            found, test = judge.verdict(one, worker)
            seconds = round(time.monotonic() - start, 1)
            row = {"room": room, **dict(zip(KEY, one.key, strict=True)), "line": one.line}
            row |= {"kind": one.kind, "verdict": found, "test": test, "seconds": seconds}
            results.append(row)
            with path.open("a", encoding="utf-8") as file:
                print(json.dumps(row), file=file)
            print(f"{found:9} {seconds:6.1f} s  {one.file}:{one.line} {one.mutated}", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        threads = [
            threading.Thread(target=work, args=(Path(folder, str(i)),)) for i in range(given.jobs)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        shutil.rmtree(folder, ignore_errors=True)
        os.mkdir(folder)
    lines, survivors, well = table(sorted(results, key=lambda row: row["room"]), verdicts())
    print(*lines, sep="\n")
    for row in survivors:
        print(f"not named: {row['file']}:{row['line']}  {row['source']}\n    {row['mutated']}")
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())

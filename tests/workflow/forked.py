"""Snakemake forked from a process that has imported it: half of the time of a dry run is imports.

Nothing of this project is loaded before the fork.
"""

import contextlib
import functools
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

SNAKEMAKE = Path(sys.executable).with_name("snakemake")

#: Seconds after which a run is killed.
LONGEST = 1800


def run(folder, arguments, printed):
    """Run Snakemake in a folder; return its exit status.

    Parameters
    ----------
    folder : str or os.PathLike
    arguments : sequence of str
    printed : str or os.PathLike
        File for all that it prints.
    """
    order = {
        "folder": str(folder),
        "arguments": [str(SNAKEMAKE), *map(str, arguments)],
        "printed": str(printed),
        "environment": {**os.environ},
    }
    server = _server()
    print(json.dumps(order), file=server.stdin, flush=True)
    return json.loads(server.stdout.readline())


@functools.cache
def _server():
    """Return the process that forks, one for all tests of this one; it ends with its input."""
    # Not the folder it stands in, which is this checkout.
    command = [sys.executable, "-P", __file__]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _serve():
    from snakemake import cli

    for line in sys.stdin:
        child = os.fork()
        if not child:
            _become(**json.loads(line))
            cli.main()
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def _become(folder, arguments, printed, environment):
    """Be what a shell would have started."""
    signal.alarm(LONGEST)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = arguments
    with open(os.devnull) as empty, open(printed, "w", encoding="utf-8") as output:
        os.dup2(empty.fileno(), 0)
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        _serve()

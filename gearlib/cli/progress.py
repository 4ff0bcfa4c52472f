"""Progress on a terminal while a computation lasts; elsewhere nothing is shown.

Nothing is shown in the first two seconds; what is shown goes to standard error and is gone when
the computation ends.
"""

import sys
import threading
from contextlib import contextmanager

#: Seconds of silence.
DELAY = 2.0


@contextmanager
def _shown(*columns, description, total):
    """Show a bar after the delay; give a function that advances it."""
    if not sys.stderr.isatty():
        yield lambda steps: None
        return
    from rich.console import Console
    from rich.progress import Progress

    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task(description, total=total)
    # The kernels release the interpreter lock: the bar's own thread goes on beside them.
    timer = threading.Timer(DELAY, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda steps: bar.advance(task, steps)
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


def clock(description):
    """Show the elapsed time of one long call."""
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    return _shown(*columns, description=description, total=None)


def counter(description, total):
    """Show how many of `total` steps are done; gives a function that takes the newly done."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    return _shown(*columns, description=description, total=total)

"""Progress bars for long calls, and time limits after which calls return what they have computed.

With `max_seconds`, a call starts no further step after that time, but it always takes the first
step. Its dataset then has the variable `complete` (1 or 0) and the attribute `missing`, a list of
what was not computed: values of a coordinate, which the dataset lacks, or intervals [from, to] of
the coordinate. Without `max_seconds`, the dataset has neither.
"""

import json
import math
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

#: Time before a progress bar appears, s.
DELAY = 2.0
#: Held by the call that shows a progress bar.
_progress_bar_lock = threading.Lock()


def is_interactive() -> bool:
    """Return whether somebody sees stderr, in a terminal or a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    # The stderr of a notebook is not a terminal.
    return hasattr(shell, "kernel") or bool(sys.stderr and sys.stderr.isatty())


def with_progress_bar(unit: str, items: Iterable, total: int | None = None) -> Iterator:
    """Yield `items` and show a progress bar on stderr if it is a terminal, or in a notebook.

    While another call shows a progress bar, this call shows none. `unit` is a plural noun for the
    items, such as "runs"; `total` is their number, or None if it is unknown.
    """
    # `disable=None` of tqdm would hide the bar in a notebook.
    if not is_interactive() or not _progress_bar_lock.acquire(blocking=False):
        yield from items
        return
    try:
        with warnings.catch_warnings():
            # In notebooks without widgets, tqdm warns that it shows the bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
        # Thanks to the delay, short calls show no progress bar.
        yield from tqdm(items, total=total, unit=f" {unit}", delay=DELAY, leave=False)
    finally:
        _progress_bar_lock.release()


class TimeLimit:
    """The time limit of a call; `complete` is True until a step is refused because of it."""

    def __init__(self, max_seconds: float | None):
        """Start the clock; if `max_seconds` is None, there is no limit."""
        self.is_set = max_seconds is not None
        self.complete = self._is_first_step = True
        self._end_time = math.inf if max_seconds is None else time.monotonic() + max_seconds

    def is_over(self) -> bool:
        """Return whether the time is over, so that the next step must not start.

        The caller asks before each step. The first step may always start. When the time is over,
        the attribute `complete` becomes False for good.
        """
        is_first_step, self._is_first_step = self._is_first_step, False
        self.complete = self.complete and (is_first_step or time.monotonic() < self._end_time)
        return not self.complete

    def iterate(self, items: Iterable) -> Iterator:
        """Yield items until there are no more or the time is over; always yield the first one."""
        for item in items:
            if self.is_over():
                return
            yield item

    def record_missing(self, dataset: Any, missing: Iterable = (), **is_computed: Any) -> Any:
        """Return the dataset with variable `complete` and attribute `missing` if a limit is set.

        `missing` lists what was not computed, e.g. values of a coordinate; `complete` is 1 if the
        list is empty, else 0. Instead of `missing`, the caller can pass a mask of the computed
        entries along a dimension, by keyword: the other entries are then removed, and `missing`
        lists their coordinates.
        """
        if not self.is_set:
            return dataset
        for dim, mask in is_computed.items():
            missing = dataset[dim].values[~mask].tolist()
            dataset = dataset.isel({dim: mask})
        attrs = {"units": "1", "long_name": "whether all was done within max_seconds"}
        dataset = dataset.assign(complete=((), int(not missing), attrs))
        return dataset.assign_attrs(missing=json.dumps(missing))

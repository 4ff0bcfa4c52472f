"""Progress bars of long calls, and time limits at which calls return what they have computed.

With `max_seconds` a call begins no further step after that time, except that it always takes the
first step. Its dataset then has the variable `complete`, 1 or 0, and the attribute `missing`, which
lists what was not computed: values of a coordinate, which the dataset lacks, or intervals
[from, to] of the coordinate. Without `max_seconds` the dataset has neither.
"""

import json
import math
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

#: Seconds until a bar appears.
DELAY = 2.0
_bar_is_shown = threading.Lock()


def with_bar(unit: str, items: Iterable, total: int | None = None) -> Iterator:
    """Yield items, while a progress bar on stderr counts them in a terminal or notebook.

    There is no bar while another call shows one, which the lock `_bar_is_shown` tells. `unit` is
    the plural noun of the items, such as "runs"; `total` is their number, None if it is not known.
    """
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    # A notebook is no terminal for tqdm, whose `disable=None` would hide the bar there.
    is_watched = hasattr(shell, "kernel") or bool(sys.stderr and sys.stderr.isatty())
    if not is_watched or not _bar_is_shown.acquire(blocking=False):
        yield from items
        return
    try:
        with warnings.catch_warnings():
            # tqdm warns in notebooks without widgets, where it shows the bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
        # The bar appears after `DELAY` seconds, so that short calls show none.
        yield from tqdm(items, total=total, unit=f" {unit}", delay=DELAY, leave=False)
    finally:
        _bar_is_shown.release()


class Limit:
    """The time limit of a call."""

    def __init__(self, max_seconds: float | None):
        """Start the clock; with None as `max_seconds` there is no limit."""
        self.is_set, self.complete, self._is_first = max_seconds is not None, True, True
        self._end = math.inf if max_seconds is None else time.monotonic() + max_seconds

    def is_over(self) -> bool:
        """Return True if the next step must not begin, because the time limit has passed.

        The first step may always begin. As soon as a step must not begin, the attribute `complete`,
        which is True at first, becomes False and stays so.
        """
        is_first, self._is_first = self._is_first, False
        self.complete = self.complete and (is_first or time.monotonic() < self._end)
        return not self.complete

    def each(self, items: Iterable) -> Iterator:
        """Yield items until they end or the time is over; always yield the first item."""
        for item in items:
            if self.is_over():
                return
            yield item

    def mark(self, dataset: Any, missing: Iterable = (), **done: Any) -> Any:
        """Return a dataset with variable `complete` and attribute `missing` if there is a limit.

        `missing` lists what was not computed, for example values of a coordinate; `complete` is 1
        if this list is empty, else 0. Instead of `missing`, the caller can give a dimension as
        keyword with a mask of its computed entries: the other entries are then removed, and their
        coordinates are listed.
        """
        if not self.is_set:
            return dataset
        for dim, mask in done.items():
            missing = dataset[dim].values[~mask].tolist()
            dataset = dataset.isel({dim: mask})
        attrs = {"units": "1", "long_name": "whether all was done within max_seconds"}
        dataset = dataset.assign(complete=((), int(not missing), attrs))
        return dataset.assign_attrs(missing=json.dumps(missing))

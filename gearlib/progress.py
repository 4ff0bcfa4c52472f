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
    """Yield items, with a progress bar on stderr in a terminal or notebook.

    There is no bar while another call shows one. `unit` is the plural noun of the items, such as
    "runs"; `total` is their number, None if it is not known.
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
        yield from tqdm(items, total=total, unit=f" {unit}", delay=DELAY, leave=False)
    finally:
        _bar_is_shown.release()


class Limit:
    """The time limit of a call."""

    def __init__(self, max_seconds: float | None):
        """Start the time; with None there is no limit."""
        self.is_set, self.complete, self._is_first = max_seconds is not None, True, True
        self._end = math.inf if max_seconds is None else time.monotonic() + max_seconds

    def is_over(self) -> bool:
        """Return whether the next step must not begin because the time is over.

        The first step may always begin. The attribute `complete` becomes False when time is over.
        """
        is_first, self._is_first = self._is_first, False
        self.complete = self.complete and (is_first or time.monotonic() < self._end)
        return not self.complete

    def each(self, items: Iterable) -> Iterator:
        """Yield items until the time is over."""
        for item in items:
            if self.is_over():
                return
            yield item

    def mark(self, dataset: Any, missing: Iterable = (), **done: Any) -> Any:
        """Return a dataset with `complete` and `missing` added if the time is limited.

        `missing` lists what was not computed. Alternatively `done` has the name of a dimension as
        keyword and a mask of its computed entries; the other entries are left out and are missing.
        """
        if not self.is_set:
            return dataset
        for dim, mask in done.items():
            missing = dataset[dim].values[~mask].tolist()
            dataset = dataset.isel({dim: mask})
        attrs = {"units": "1", "long_name": "whether all was done within max_seconds"}
        dataset = dataset.assign(complete=((), int(not missing), attrs))
        return dataset.assign_attrs(missing=json.dumps(missing))

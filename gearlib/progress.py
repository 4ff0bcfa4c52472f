"""Progress bars of long calls, and the time after which they return what is done.

With `max_seconds` a call begins no further step after that time; it always takes the first one. Its
dataset then has `complete`, 1 or 0, and the attribute `missing`: a list of what was not reached, by
values of the coordinate, from which they are left out, or as intervals [from, to] of it. Without
`max_seconds` there is neither.
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
    """Yield items; show a bar on stderr in a terminal or notebook, unless another call shows one.

    `unit` is the plural noun of the items, `total` their number.
    """
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    # For tqdm a notebook is no terminal, and `disable=None` would hide the bar there.
    is_watched = hasattr(shell, "kernel") or bool(sys.stderr and sys.stderr.isatty())
    if not is_watched or not _bar_is_shown.acquire(blocking=False):
        yield from items
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that notebooks without widgets show the bar as text
            from tqdm.auto import tqdm
        yield from tqdm(items, total=total, unit=f" {unit}", delay=DELAY, leave=False)
    finally:
        _bar_is_shown.release()


class Limit:
    """The time that a call may take from now on."""

    def __init__(self, max_seconds: float | None):
        """Start the time; it never ends with None."""
        self.is_set, self.complete, self._is_first = max_seconds is not None, True, True
        self._end = math.inf if max_seconds is None else time.monotonic() + max_seconds

    def is_over(self) -> bool:
        """Return whether the time is over, not yet at the first step; `complete` is then False."""
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
        """Return a dataset with `complete` and `missing`, a list, if the time is limited.

        `done` has a mask by dimension, of what was reached; the rest is left out, and missing.
        """
        for dim, mask in done.items() if self.is_set else ():
            missing = dataset[dim].values[~mask].tolist()
            dataset = dataset.isel({dim: mask})
        if not self.is_set:
            return dataset
        attrs = {"units": "1", "long_name": "whether all was done within max_seconds"}
        dataset = dataset.assign(complete=((), int(not missing), attrs))
        return dataset.assign_attrs(missing=json.dumps(missing))

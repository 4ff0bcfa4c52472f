"""Progress bars in Jupyter, which disappear when a call ends.

Outside Jupyter nothing is shown. In nested calls only the outermost shows a bar.
"""

import sys
import threading
import time
from contextlib import contextmanager

#: Seconds until a bar appears, and between two updates.
DELAY, STEP = 2.0, 0.5

_bar_shown = threading.Lock()


@contextmanager
def bar(noun, total, finished_count):
    """Show a progress bar in Jupyter, updated by a thread, while the context lasts.

    `noun` is the plural noun of the items, `total` is their number, and the function
    `finished_count` returns how many are finished.
    """
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if not hasattr(shell, "kernel") or not _bar_shown.acquire(blocking=False):
        yield
        return
    ended = threading.Event()
    arguments = (noun, total, finished_count, ended)
    # The engines release the interpreter lock, so the thread runs beside them.
    thread = threading.Thread(target=_update, args=arguments, daemon=True)
    try:
        thread.start()
        yield
    finally:
        ended.set()
        thread.join()
        _bar_shown.release()


def _update(noun, total, finished_count, ended):
    """Display a progress bar (arguments as for `bar`) until `ended` is set, then clear it."""
    from IPython.display import display

    start_time, handle = time.monotonic(), None
    while not ended.wait(STEP if handle else DELAY):
        count = finished_count()
        text = f"{count} of {total} {noun}, {time.monotonic() - start_time:.0f} s"
        html = f'<progress value="{count}" max="{total}"></progress> {text}'
        content = {"text/plain": text, "text/html": html}
        if handle:
            handle.update(content, raw=True)
        else:
            handle = display(content, raw=True, display_id=True)
    if handle:
        handle.update({"text/plain": "", "text/html": ""}, raw=True)


@contextmanager
def counting_bar(noun, total, callback=None):
    """Show a progress bar; yield a function to call with the number of newly finished items.

    `noun` is the plural noun of the items. `callback`, if given, is called with the same number.
    """
    finished = 0

    def add(count):
        """Add a number of finished items, and pass it on to the callback."""
        nonlocal finished
        finished += count
        if callback is not None:
            callback(count)

    with bar(noun, total, lambda: finished):
        yield add


def with_bar(noun, items, total):
    """Yield `items`, and show a progress bar with the number of finished items out of `total`."""
    with counting_bar(noun, total) as add:
        for item in items:
            yield item
            add(1)

"""Bars of progress in Jupyter: shown while a long call lasts, gone when it ends.

Outside a kernel of Jupyter nothing is shown. Of calls within calls the outermost shows its bar.
"""

import sys
import threading
import time
from contextlib import contextmanager

#: Seconds until a bar appears, and between two updates.
DELAY, STEP = 2.0, 0.5

_bar_shown = threading.Lock()


@contextmanager
def bar(noun, total, done):
    """Show how many of `total` things are done, as the function `done` says, from a thread."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if not hasattr(shell, "kernel") or not _bar_shown.acquire(blocking=False):
        yield
        return
    ended = threading.Event()
    # The engines release the interpreter lock, so the thread runs beside them.
    thread = threading.Thread(target=_update, args=(noun, total, done, ended), daemon=True)
    try:
        thread.start()
        yield
    finally:
        ended.set()
        thread.join()
        _bar_shown.release()


def _update(noun, total, done, ended):
    """Update a bar until the event `ended`, then empty it."""
    from IPython.display import display

    start, handle = time.monotonic(), None
    while not ended.wait(STEP if handle else DELAY):
        count = done()
        text = f"{count} of {total} {noun}, {time.monotonic() - start:.0f} s"
        html = f'<progress value="{count}" max="{total}"></progress> {text}'
        shown = {"text/plain": text, "text/html": html}
        if handle:
            handle.update(shown, raw=True)
        else:
            handle = display(shown, raw=True, display_id=True)
    if handle:
        handle.update({"text/plain": "", "text/html": ""}, raw=True)


@contextmanager
def telling(noun, total, tell=None):
    """Yield a function that takes how many things are newly done, shows it and calls `tell`."""
    done = 0

    def add(count):
        nonlocal done
        done += count
        if tell is not None:
            tell(count)

    with bar(noun, total, lambda: done):
        yield add


def counted(noun, items, total):
    """Yield the `total` items, and show how many have been worked on."""
    with telling(noun, total) as add:
        for item in items:
            yield item
            add(1)

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
    """Show a progress bar in Jupyter, updated by a thread, while the context lasts.

    `noun` is the plural noun of the items, `total` is their number, and the function `done`
    returns how many are finished.
    """
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
    """Display and update a progress bar until the event `ended` is set, then clear it.

    `done` returns how many of the `total` items, named by the plural `noun`, are finished.
    """
    from IPython.display import display

    start_time, handle = time.monotonic(), None
    while not ended.wait(STEP if handle else DELAY):
        count = done()
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
def telling(noun, total, tell=None):
    """Show a progress bar; yield a function to call with the number of newly finished items.

    `noun` is the plural noun of the items; `tell`, if any, is called with the same number.
    """
    done = 0

    def add(count):
        nonlocal done
        done += count
        if tell is not None:
            tell(count)

    with bar(noun, total, lambda: done):
        yield add


def counted(noun, items, total):
    """Yield `items`, with a progress bar of how many of `total` are finished, named by `noun`."""
    with telling(noun, total) as add:
        for item in items:
            yield item
            add(1)

"""What a notebook shows while a long call lasts: a bar, which is gone when the call ends.

It needs nothing but what each kernel of Jupyter has, and does nothing elsewhere. Of calls within
calls the outermost shows its own.
"""

import sys
import threading
import time
from contextlib import contextmanager

#: Seconds of silence, and those from one look to the next.
DELAY, STEP = 2.0, 0.5

_shown = threading.Lock()


def in_kernel():
    """Return whether a kernel of Jupyter runs this."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def bar(words, total, done):
    """Show how many of `total` are done, as the function `done` says, which a thread asks."""
    if not in_kernel() or not _shown.acquire(blocking=False):
        yield
        return
    ended = threading.Event()
    # The kernels release the interpreter lock: it goes on beside them.
    thread = threading.Thread(target=_follow, args=(words, total, done, ended), daemon=True)
    try:
        thread.start()
        yield
    finally:
        ended.set()
        thread.join()
        _shown.release()


@contextmanager
def telling(words, total, tell=None):
    """Yield what takes how many are newly done, shows it, and tells it to `tell`, where given."""
    done = 0

    def newly(count):
        nonlocal done
        done += count
        if tell is not None:
            tell(count)

    with bar(words, total, lambda: done):
        yield newly


def counted(words, items, total):
    """Yield the `total` items, and show how many have been worked on."""
    with telling(words, total) as newly:
        for item in items:
            yield item
            newly(1)


def _follow(words, total, done, ended):
    from IPython.display import display

    start, place, pause = time.monotonic(), None, DELAY
    while not ended.wait(pause):
        count, seconds, pause = done(), time.monotonic() - start, STEP
        text = f"{count} of {total} {words}, {seconds:.0f} s"
        show = place.update if place else display
        # The first call gives the place, the others change what is there.
        drawn = f'<progress value="{count}" max="{total}"></progress> {text}'
        kept = show({"text/plain": text, "text/html": drawn}, raw=True, **_new(place))
        place = place or kept
    if place:
        place.update({"text/plain": "", "text/html": ""}, raw=True)


def _new(place):
    return {} if place else {"display_id": True}

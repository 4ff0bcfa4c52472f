"""Checks of keys of a section that must agree; a refusal names the later key."""

from gearlib import tunings

#: Limit that catches a mistyped step before it makes as many jobs or tunings.
MAX_JOBS = 10_000


def check_count(key, start, stop, step, most):
    """Refuse a step that cuts a range into too many."""
    if stop > start and tunings.steps(start, stop, step) + 1 > most:
        raise ValueError(
            f"{key} = {step!r} is not allowed: it must be >= {(stop - start) / most:.2g} to stay "
            f"within {most:,} tunings"
        )


def check_order(key, section, low="start", high="stop"):
    """Refuse a range whose end is not above its beginning."""
    first, last = getattr(section, low), getattr(section, high)
    if last <= first:
        raise ValueError(
            f"{key}.{high} = {last!r} is not allowed: it must be greater than {key}.{low} = "
            f"{first!r}"
        )


def check_most(key, value, most, words="the {} recorded mesh periods"):
    """Refuse more than there are; `words` say what of."""
    if value > most:
        raise ValueError(
            f"{key} = {value} is not allowed: it must be an integer from 1 to {words.format(most)}"
        )


def check_different(key, entries, name):
    """Refuse two entries of a list that have one name or title."""
    found = [getattr(one, name) for one in entries]
    for i, value in enumerate(found):
        if found.count(value) > 1:
            raise ValueError(
                f"{key}[{i}].{name} = {value!r} is not allowed: {name}s must be all different"
            )


def check_grid(key, section, step_key="step"):
    """Refuse a section whose stop is not start plus a whole multiple of step, or too fine."""
    start, stop, step = section.start, section.stop, getattr(section, step_key)
    check_count(f"{key}.{step_key}", start, stop, step, MAX_JOBS)
    if stop <= start or tunings.steps(start, stop, step) % 1:
        raise ValueError(
            f"{key}.stop = {stop!r} is not allowed: it must be {key}.start = {start!r} plus a "
            f"whole multiple of {key}.{step_key} = {step!r}"
        )

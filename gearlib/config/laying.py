"""One configuration laid over another."""

from gearlib.config.gear_pair_section import IN_PLACE_OF

#: Keys of one section of which there is one.
_ALTERNATIVES = (
    {"gears", "gear_pair"},
    *({key, *others} for key, others in IN_PLACE_OF.items()),
)


def laid_over(base, change):
    """Return a copy of `base` with the keys of `change`; mappings are laid over each other.

    A key of the change takes the place of those that say the same in another way.
    """
    said = {other for group in _ALTERNATIVES for key in group & change.keys() for other in group}
    both = {key: value for key, value in base.items() if key not in said - change.keys()}
    for key, value in change.items():
        inner = isinstance(value, dict) and isinstance(base.get(key), dict)
        both[key] = laid_over(base[key], value) if inner else value
    return both

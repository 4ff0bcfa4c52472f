"""From the values of a configuration to a `GearTrain`."""

from collections.abc import Callable

from gearlib.models.harmonics import Harmonics
from gearlib.models.pair import GearPair
from gearlib.models.trains import ready_made
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.reducer import split_power_reducer
from gearlib.models.trains.train import GearTrain

_OF_PAIRS = {
    "split_power_reducer": split_power_reducer,
    "idler": ready_made.idler,
    "two_stage": ready_made.two_stage,
}


def described(kind, arguments, pair):
    """Return the train that a configuration describes.

    Parameters
    ----------
    kind : str
        "split_power_reducer", "planetary", "idler", "two_stage" or "own".
    arguments : dict
        Of the function of that name; of "own" bodies, meshes, shafts as dicts, with what else
        `GearTrain` takes.
    pair : dict
        Arguments of `GearPair`, for the trains that are made of one.

    Returns
    -------
    GearTrain

    Raises
    ------
    ValueError
        If a value is impossible or the train cannot be assembled.
    """
    if kind in _OF_PAIRS:
        return _OF_PAIRS[kind](GearPair(**pair), **arguments)
    if kind == "planetary":
        return ready_made.planetary(**arguments)
    parts: dict[str, Callable] = {"bodies": Body, "shafts": Shaft, "meshes": _mesh}
    made = {key: [make(**one) for one in arguments[key]] for key, make in parts.items()}
    return GearTrain(**(arguments | made))


def _mesh(**values):
    for key in ("deviation", "inverse_deviation"):
        if key in values:
            values[key] = Harmonics(**values[key])
    return Mesh(**values)

"""In every process that finds this file first: all starts of motions lie 1e-12 beside.

The one way in for a start is moved, not its callers: `check_run` for runs and sweeps, `start` of
propagators and `start_state` of trains for all that goes on from a state, the guess of Newton's
method, the states of a section. Which component moves how far does not depend on anything, and no
symmetry of a train survives it.
"""

import functools
import math
import os
from importlib.machinery import SourceFileLoader

SIZE = float(os.environ.get("GEARLIB_MOVED_BY", "1e-12"))


def _moved(state):
    """Return a state beside the one given, a tuple or shape (..., n); "static" stays."""
    if isinstance(state, str):
        return state
    count = len(state) if isinstance(state, tuple) else state.shape[-1]
    ways = [SIZE * math.cos(1.0 + i * i) for i in range(count)]
    if isinstance(state, tuple):
        return tuple(value + way for value, way in zip(state, ways, strict=True))
    return state + ways


def _result(owner, name):
    """Move what a function returns."""
    given = getattr(owner, name)

    @functools.wraps(given)
    def start(*arguments, **options):
        return _moved(given(*arguments, **options))

    setattr(owner, name, start)


def _runs(module):
    given = module.check_run

    def check_run(*arguments, **named):
        asked = given(*arguments, **named)
        return asked._replace(state=_moved(asked.state))

    module.check_run = check_run


def _sections(module):
    given = module.section

    def section(pair, tuning, states, *rest):
        return given(pair, tuning, _moved(states), *rest)

    module.section = section


#: Module -> what moves the starts that come in through it.
_DOORS = {
    "gearlib.runs.run_arguments": _runs,
    "gearlib.models.propagators.base": lambda module: _result(module.Base, "start"),
    "gearlib.models.propagators.piecewise_linear": lambda m: _result(m.Propagator, "start"),
    "gearlib.models.trains.train": lambda module: _result(module.GearTrain, "start_state"),
    "gearlib.analysis.orbits.shooting": lambda module: _result(module, "_guess"),
    "gearlib.analysis.global_dynamics.poincare": _sections,
}

_exec_module = SourceFileLoader.exec_module


def _exec_and_move(loader, module):
    _exec_module(loader, module)
    if module.__name__ in _DOORS:
        _DOORS[module.__name__](module)


SourceFileLoader.exec_module = _exec_and_move

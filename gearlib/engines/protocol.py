"""What all propagators offer: runs, their record, maps of small deviations, many states at once."""

from collections.abc import Callable

import numpy as np

from gearlib.engines.codes import OK


class Base:
    """A model at one tuning; a subclass, named ``Propagator``, gives `run` and `vary`.

    States z have the shape (size,) of the model: coordinates in static deflections and their rates
    by mesh phase, at the start of a mesh period.
    """

    #: What goes on between events, in words.
    words = "closed forms"
    #: States that a thread takes at a time: many to hide the hand-over, few to share out slow ones.
    chunk = 16
    #: Components of the state, and pieces of a mesh period beside its phases of contact.
    components, pieces = 2, 0
    #: Many tunings in one call, arguments as of `gearlib.integrators` with the model before them,
    #: and states at one phase of every period, as of `gearlib.engines.pair.sections.section`
    #: without the mesh; None: not in one call.
    run_many: Callable | None = None
    sections: Callable | None = None
    #: Whether periods that `run` returns are proven, see `stable_repeats`, or those of its states.
    proves_periods = False

    def __init__(self, model, tuning):
        self.model, self.tuning = model, tuning

    def at(self, tuning):
        """Return the propagator of another tuning, with what does not depend on the tuning."""
        return type(self)(self.model, tuning)

    def start(self, state):
        """Return the state z for a displacement and dx/dtau at tau = 0."""
        return np.array(state, float)

    def run(self, z, periods, record_periods, samples, events, limit, summary, first=0):
        """Run from z, which is changed in place to the end of the run.

        Arguments and returns as of `gearlib.engines.pair.pair_run.run`, whose returns are
        followed by the number of evaluations of the right-hand side; `first` is the mesh period of
        the run-out in which the run begins.
        """
        raise NotImplementedError

    def vary(self, z, periods, limit, maps, first):
        """Fill `maps`, shape (periods, size, size); z is changed in place to the end.

        Returns the status. See `maps`.
        """
        raise NotImplementedError

    def maps(self, z, periods, limit, first=0):
        """Go through mesh periods from z and linearise each; no finite differences.

        Along the phases of contact the derivative is that of the motion itself, at flank crossings
        the saltation matrix; see `gearlib.engines.pair.pair_maps`. `limit` is the most
        events in one period, `first` as of `run`.

        Returns
        -------
        end : ndarray, shape (size,)
        maps : ndarray, shape (periods, size, size)
            Derivative of the state at the end of each period by that at its start.
        code : int
            `gearlib.data.status`; if not OK, the maps are NaN.
        """
        z = np.array(z, float)
        maps = np.empty((periods, z.size, z.size))
        code = self.vary(z, periods, limit, maps, first)
        if code != OK:
            maps[:] = np.nan
        return z, maps, code

    def watched(self, z, periods, limit, first=0):
        """Return (end, maps, status, events, summary): what `maps` and `run` tell."""
        samples, events, summary = self.model.empty_record()
        rest = periods, periods, samples, events, limit, summary
        events, found, code = self.run(z.copy(), *rest, first=first)[3:6]
        end, maps, own = self.maps(z, periods, limit, first)
        return end, maps, own or code, events[:found], summary

    def record(self, z, periods, limit, samples_per_period=0):
        """Run from z and record it all; z stays.

        Returns (events, summary, samples) as of `gearlib.engines.pair.pair_run`; `samples`
        of shape (periods * samples_per_period, 6 or more).
        """
        return self.recorded(z, periods, limit, samples_per_period)[:3]

    def recorded(self, z, periods, limit, samples_per_period=0):
        """Return the same and the status."""
        samples, events, summary = self.model.empty_record(periods * samples_per_period)
        done = self.run(np.array(z, float), periods, periods, samples, events, limit, summary)
        return done[3][: done[4]], summary, samples, done[5]

    def skip(self, states, periods, limit, ends, codes):
        """Take states, shape (k, size), through mesh periods; fill their ends and their status."""
        samples, events, summary = self.model.empty_record(events=0)
        ends[:] = states
        for i, z in enumerate(ends):
            codes[i] = self.run(z, periods, 1, samples, events, limit, summary)[5]

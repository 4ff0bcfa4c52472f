"""What a proof starts from: the laws of a model in balls, the contacts of a motion in floats."""

import math

from gearlib.analysis.orbits.shooting import resting
from gearlib.analysis.proofs.balls import COARSE, precision
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.closed_laws import ClosedLaws
from gearlib.analysis.proofs.train_laws import TrainLaws
from gearlib.analysis.proofs.train_numbers import parts_of
from gearlib.data.status import JAMMED, MESSAGES
from gearlib.kernels import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS


def _closed(model):
    return model.equation is not None and model.equation.is_piecewise_linear()


def check_model(model):
    """Raise `Uncertain` for a model without a proof."""
    if not _closed(model):
        with precision(COARSE):
            parts_of(model)


def laws_of(model, tuning):
    """Return the laws of motion of a model in balls."""
    return (ClosedLaws if _closed(model) else TrainLaws)(model, tuning)


def laws_over_tunings(model, tuning):
    """Return the same; raise `Uncertain` where they depend on the tuning."""
    laws = laws_of(model, tuning)
    if laws.tuned:
        raise Uncertain(
            "model",
            f"over the tuning no {type(model).__name__} with harmonics of load, deviation or "
            "run-out is proven",
        )
    return laws


def listed_contacts(orbit):
    """Return (contact codes of all meshes at tau = 0, events) of the motion from a candidate.

    Events are (phase, mesh, code before, code after), phases counted on over the mesh periods; the
    candidate has to list them.
    """
    model, state, period = orbit.pair, orbit.state, orbit.period
    events, summary, _, code = model.propagator(orbit.tuning).recorded(state, period, MAX_EVENTS)
    if code == JAMMED:
        raise Uncertain("jammed", MESSAGES[JAMMED])
    table = [
        (
            2.0 * math.pi * row[columns.EVENT_PERIOD] + row[columns.EVENT_PHASE],
            # Behind the columns of every event the mesh, where there are several.
            int(row[columns.EVENT_COLUMNS]) if len(row) > columns.EVENT_COLUMNS else 0,
            int(row[columns.EVENT_FROM]),
            int(row[columns.EVENT_TO]),
        )
        for row in events
    ]
    codes = resting(summary[..., columns.X_MIN], summary[..., columns.X_MAX], *model.flank_lines)
    pattern = tuple(codes) if not table else (table[0][2], *(after for *_, after in table))
    for _, mesh, before, _ in reversed(table):
        codes[mesh] = before
    if pattern != tuple(orbit.pattern):
        raise Uncertain(
            "contacts",
            f"the motion from the candidate has the contacts {pattern}, not the listed "
            f"{tuple(orbit.pattern)}",
        )
    return codes, table

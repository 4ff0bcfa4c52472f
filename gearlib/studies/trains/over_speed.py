"""Every mesh of the train of the configuration over speed: from all starts, and carried."""

import numpy as np

from gearlib.data.result import result
from gearlib.models.trains.described_train import described
from gearlib.runs.sweeping import DIRECTIONS
from gearlib.studies.trains import motions

#: What is kept of every motion: median and range over its starts.
_KEPT = ("dynamic_factor", "load_sharing", "fraction_normal")


def compute(train, tunings, settings):
    """Return the resonance characteristics of all meshes, from static equilibrium.

    train: arguments of `gearlib.models.trains.described_train.described`; tunings: shape (t,);
    settings: as in `gearlib.studies.trains.motions`.

    As of `gearlib.studies.trains.motions.over_directions`, and `GearTrain.layout`.
    """
    model, tunings = described(**train), np.asarray(tunings, float)
    dataset, _ = motions.over_directions(model, tunings, settings, _KEPT, DIRECTIONS)
    dataset = dataset.assign(speed=("tuning", model.speed(tunings)))
    dataset = dataset.assign_coords(tuning=tunings, mesh=list(model.mesh_names))
    dataset = dataset.merge(model.layout())
    title = "All meshes of a gear train over speed"
    return result(title, model, dataset, method="exact", initial_state="static", **settings)

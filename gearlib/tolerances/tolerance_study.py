"""Tolerances in the workflow: shards of `gearlib.scatter`, and Sobol' indices."""

from gearlib.models.geometry import described_drawing
from gearlib.models.pair import GearPair
from gearlib.tolerances.designs import DrawnPair
from gearlib.tolerances.indices import sobol_indices
from gearlib.tolerances.scatter import shard as shard_of


def model_of(pair, drawing=None):
    """Return what scatters: a `GearPair` by its parameters, or its drawing.

    `drawing`: what `Gears.described` returns; dampings are those of the pair.
    """
    model = GearPair(**pair)
    if drawing is None:
        return model
    return DrawnPair(
        described_drawing.mesh(drawing),
        backlash=None if drawing.get("backlash") is None else "drawing",
        torque=drawing["torque"],
        stiffness=drawing.get("stiffness"),
        options=drawing.get("stiffness_options"),
        material_damping=model.material_damping,
        backlash_damping_ratio=model.backlash_damping_ratio,
    )


def compute(*, pair, tolerances, samples, shard, threads, drawing=None, **asked):
    """Return a shard, "first-last", of `gearlib.scatter`; other arguments are as there."""
    first, last = map(int, shard.split("-"))
    model = model_of(pair, drawing)
    return shard_of(model, tolerances, samples, first, last, threads=threads, **asked)


def indices(*, pair, tolerances, samples, drawing=None, **asked):
    """Return Sobol' indices, see `gearlib.tolerances.indices.sobol_indices`."""
    return sobol_indices(model_of(pair, drawing), tolerances, n=samples, **asked)

"""What models that contain a `GearPair` offer of it.

Every name that is offered is listed: a name that means something else for the model, or nothing,
does not reach the pair unseen.
"""

from typing import Any

from gearlib.models.model import Model


def _of_pair(name):
    return property(lambda model: getattr(model.pair, name), doc=f"`GearPair.{name}` of the pair.")


class WithPair(Model):
    """A model with a `GearPair` as its field ``pair``, whose scales and ratios are its own."""

    pair: Any  #: the `GearPair`, a field of subclasses
    mesh = property(lambda model: model.pair, doc="The pair.")
    max_stiffness = _of_pair("max_stiffness")
    min_stiffness = _of_pair("min_stiffness")
    mean_stiffness = _of_pair("mean_stiffness")
    stiffness_ratio = _of_pair("stiffness_ratio")
    contact_ratio = _of_pair("contact_ratio")
    reduced_mass = _of_pair("reduced_mass")
    load = _of_pair("load")
    backlash = _of_pair("backlash")
    backlash_ratio = _of_pair("backlash_ratio")
    material_damping = _of_pair("material_damping")
    damping_ratio = _of_pair("damping_ratio")
    backlash_damping = _of_pair("backlash_damping")
    backlash_damping_ratio = _of_pair("backlash_damping_ratio")
    teeth = _of_pair("teeth")
    static_deflection = _of_pair("static_deflection")
    mean_eigenfrequency = _of_pair("mean_eigenfrequency")
    flank_lines = _of_pair("flank_lines")
    tuning_factor_max = _of_pair("tuning_factor_max")
    tuning_factor_min = _of_pair("tuning_factor_min")
    tuning_max = _of_pair("tuning_max")
    tuning_min = _of_pair("tuning_min")
    mesh_frequency = _of_pair("mesh_frequency")
    scales = _of_pair("scales")
    speed = _of_pair("speed")

"""What models that contain a `GearPair` offer of it, and copies of models with some values changed.

Every name that is offered is listed: a name that means something else for the model, or nothing,
does not reach the pair unseen.
"""

import dataclasses

from gearlib import checks
from gearlib.models.pair import GearPair


def replaced(model, changes):
    """Return a copy of a model with some fields changed: its own, or those of its `GearPair`.

    A field that has the value which another one gives it by default (``by_default`` of the model)
    goes on following that one, unless it is changed itself.

    Raises
    ------
    ValueError
        If there is no field of a name, or the model does not allow a value.
    """
    own = [field.name for field in dataclasses.fields(model)]
    of_pair = [field.name for field in dataclasses.fields(GearPair)] if "pair" in own else []
    checks.known(type(model).__name__, changes, list(dict.fromkeys(own + of_pair)))
    following = {
        name: None
        for name, default in model.by_default.items()
        if name not in changes and getattr(model, name) == default(model)
    }
    inner = {name: value for name, value in changes.items() if name not in own}
    changes = {name: value for name, value in changes.items() if name in own}
    model = dataclasses.replace(model, **changes, **following)
    if inner:
        model = dataclasses.replace(model, pair=model.pair.replace(**inner), **following)
    return model


def _of_pair(name):
    return property(lambda model: getattr(model.pair, name), doc=f"`GearPair.{name}` of the pair.")


class WithPair:
    """A model with a `GearPair` as its field ``pair``, whose scales and ratios are its own."""

    #: name of a field -> its value by default, from the model
    by_default: dict = {}

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
    speed_scales = _of_pair("speed_scales")

    def replace(self, **changes):
        """Return a copy with some parameters changed, of the model or of its pair (and checked).

        A name that both have is that of the model. Values that follow from others by default go on
        doing so where they do: a `SixDegreePair` takes new torques from a new load, unless its
        torques are others than those of the load.
        """
        return replaced(self, changes)

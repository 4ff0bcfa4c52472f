"""Maps of small deviations, as of `Model.propagator`, without the free rotation."""


def without_rotation(model, maps):
    """Return the maps without the free rotation, shape as of `Model.reduction`."""
    reduce, lift = model.reduction()
    return reduce @ maps @ lift

"""Names of measured quantities (observableId), with CF units and descriptions.

A name may have a suffix, e.g. for the location of a sensor, as in ``acceleration_bearing_2``.
"""

#: Quantities that become coordinates.
COORDINATES = {
    "time": ("s", "time"),
    "speed": ("min-1", "speed of the gear whose revolutions count"),
    "direction": ("1", "1: speed going up, -1: down, 0: each from rest"),
    "condition": ("1", "simulationConditionId"),
}
#: Speeds at which the motion changes; each is a single number.
SPEEDS = {
    "jump_up": ("min-1", "speed at which the motion jumps while the speed goes up"),
    "jump_down": ("min-1", "speed at which the motion jumps while the speed goes down"),
    "onset_of_contact_loss": ("min-1", "speed from which contact is lost"),
}
#: If the units are "", the observable has the units of the measured channel.
OBSERVABLES = {
    "displacement": ("m", "relative mesh displacement"),
    "displacement_max": ("m", "largest displacement"),
    "displacement_min": ("m", "least displacement"),
    "orbit_height": ("m", "largest less least displacement"),
    "transmission_error": ("m", "transmission error along the line of action"),
    "body_motion": ("m", "displacement of a body"),
    "velocity": ("m s-1", "relative mesh velocity"),
    "acceleration": ("m s-2", "acceleration"),
    "dynamic_force": ("N", "dynamic mesh force"),
    "dynamic_force_max": ("N", "largest dynamic mesh force"),
    "dynamic_force_min": ("N", "least dynamic mesh force"),
    "mean_force": ("N", "mean of the mesh force"),
    "friction_force": ("N", "friction force across the line of action"),
    "bearing_force": ("N", "force of a bearing"),
    "load": ("N", "static mesh force"),
    "torque": ("N m", "torque"),
    "angle": ("rad", "angle of a shaft"),
    "fraction_drive": ("1", "fraction of time in drive-side contact"),
    "contact_loss_fraction": ("1", "fraction of time without contact"),
    "fraction_coast": ("1", "fraction of time in coast-side contact"),
    "bounces": ("1", "losses of drive-side contact per mesh period"),
    "load_sharing": (
        "1",
        "load sharing, mesh force over the mean of those of the same central gear",
    ),
    "order_amplitude": ("", "amplitude of an order"),
    "order_phase": ("rad", "phase of an order"),
    "temperature": ("K", "temperature"),
}
KNOWN_QUANTITIES = COORDINATES | SPEEDS | OBSERVABLES
#: Units that an amplitude may have.
_AMPLITUDE_UNITS = ("m", "N", "m s-2", "m s-1", "N m", "rad", "1")
#: CF units -> the usual notation.
_WRITTEN_UNITS = {"min-1": "rpm", "m s-1": "m/s", "m s-2": "m/s^2"}


def units_and_description(name):
    """Return (CF units, description) of a measured quantity, or None if its name is unknown.

    A suffix of an observable, as in ``acceleration_bearing_2``, is appended to the description.
    Coordinates and speeds must have no suffix.
    """
    base_names = [base for base in KNOWN_QUANTITIES if name == base or name.startswith(f"{base}_")]
    # "displacement_max" also begins with "displacement"; the longest match is the base name.
    base_name = max(base_names, key=len, default=None)
    if base_name is None or (base_name != name and base_name not in OBSERVABLES):
        return None
    units, description = KNOWN_QUANTITIES[base_name]
    return units, description + name[len(base_name) :].replace("_", " ")


def allowed_units(units):
    """Return the units that a measured channel may have, as a list of (CF, customary notation).

    `units` are the CF units of the observable; if they are "", all `_AMPLITUDE_UNITS` are allowed.
    The unit "1" is for values relative to a scale of the model, such as the static deflection.
    """
    allowed = _AMPLITUDE_UNITS if units == "" else (units,)
    if units in ("m", "N", "m s-1", "m s-2"):
        allowed = (*allowed, "1")
    return [(unit, _WRITTEN_UNITS.get(unit, unit)) for unit in allowed]

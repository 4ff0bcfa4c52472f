"""Studies of drawn gears: mesh stiffness, what its rectangle costs, dynamic factor, tip relief."""

from gearlib.config import gear_names
from gearlib.config.dynamic_factor_section import DynamicFactor
from gearlib.config.relief_section import HarrisMap, ReliefDynamics
from gearlib.config.stiffness_section import MeshStiffness, PublishedPair, Rectangle
from gearlib.config.studies.study import (
    DRAWN,
    GRID,
    Drawing,
    Job,
    Study,
    Table,
    grid_of,
    no_relief,
    without,
)

#: Section -> its key of drawn gears.
_KEYS = {"mesh_stiffness": "pairs", "dynamic_factor": "pair", "harris_map": "gears"}


def _takes_own(c, section):
    """Return whether a section is about the gears of the configuration: it names no others."""
    return c.gears is not None and _KEYS[section] not in getattr(c, section).model_fields_set


def drawn(c, section):
    """Return name -> `PublishedPair` of a section: its gears, else those of the configuration."""
    if not _takes_own(c, section):
        given = getattr(getattr(c, section), _KEYS[section])
        return given if section == "mesh_stiffness" else {section: given}
    own = {"pinion": c.gears.pinion, "wheel": c.gears.wheel}
    name = f"z{own['pinion'].teeth}-{own['wheel'].teeth}"
    if section == "harris_map":
        # The map is that of the reliefs it finds.
        own = {key: gear.model_copy(update={"tip_relief": None}) for key, gear in own.items()}
    more = {key: getattr(c.gears, key) for key in ("centre_distance", "backlash")}
    return {name: PublishedPair.unchecked(**own, **more, torque=c.gears.driving_torque())}


def _one(c, section):
    return next(iter(drawn(c, section).values()))


def _written(pair):
    """Return a pair as plain values, without what others publish."""
    return pair.model_dump(exclude={"published"})


def _names(section):
    """Return the function of the configuration that names the gears of a section."""
    return lambda c: " and ".join(
        dict.fromkeys(map(gear_names.of_drawing, drawn(c, section).values()))
    )


def _place(c, section, name):
    """Return the key of a pair of a section."""
    if _takes_own(c, section):
        return "gears"
    return f"{section}.{_KEYS[section]}" + (f".{name}" if section == "mesh_stiffness" else "")


def _refusal(section, bare):
    """Return the function of the configuration that says why a section cannot take its gears."""

    def refusal(c):
        for name, pair in drawn(c, section).items():
            if bare and (words := no_relief(_place(c, section, name), pair)):
                return words
        if _takes_own(c, section):
            try:
                getattr(c, section).check_gears("gears", _one(c, section))
            except ValueError as error:
                return str(error)
        return ""

    return refusal


def _about(section, bare=False):
    """Return what a study says of the gears of a section; `bare`: they must have no relief."""
    return {"gears": _names(section), "refusal": _refusal(section, bare)}


def _pairs(c):
    return {name: pair.model_dump() for name, pair in drawn(c, "mesh_stiffness").items()}


def _unrelieved(c):
    relieved = c.gears and c.gears.relief() and _takes_own(c, "mesh_stiffness")
    return " All of involutes, without tip relief or errors of teeth." if relieved else ""


def _qualities(c):
    pair = _one(c, "dynamic_factor")
    return f"{pair.pinion.quality} and {pair.wheel.quality}"


MESH_STIFFNESS = Study(
    "mesh_stiffness",
    MeshStiffness,
    DRAWN,
    Job(
        "mesh_stiffness",
        "mesh_stiffness:compute",
        lambda c: {"pairs": _pairs(c), "samples": c.mesh_stiffness.samples},
        kernels=(),
    ),
    Table(
        "mesh_stiffness",
        "mesh_stiffness:rows",
        {"stiffness": "mesh_stiffness.nc"},
        "Mesh stiffness by every method, table",
        """For each pair and method: mean mesh stiffness in N/m, stiffness ratio, and how far
        the mean lies from that of the energy method, relative; published means below.""",
    ),
    Drawing(
        "mesh_stiffness_figure.draw",
        {"stiffness": "mesh_stiffness.nc"},
        "mesh_stiffness",
        "Mesh stiffness by every method",
        lambda c: (
            f"""Mesh stiffness of {" and ".join(drawn(c, "mesh_stiffness"))} over the mesh
        period: after the ISO standard, method B, and by the energy method, with one body
        that yields to all pairs of teeth, with a body for each pair, and with a contact
        that softens at low load. Bands: the stated uncertainty of both methods. Right: the
        means; crosses: published ones.{_unrelieved(c)}"""
        ),
    ),
    **_about("mesh_stiffness"),
)

RECTANGLE = Study(
    "rectangle",
    Rectangle,
    DRAWN,
    Job(
        "rectangle",
        "rectangle:compute",
        lambda c: {
            "pairs": _pairs(c),
            "tunings": grid_of(c.rectangle),
            "samples": c.mesh_stiffness.samples,
            "settings": without(c.rectangle, *GRID),
        },
        kernels=("kernels", "larger_kernels"),
    ),
    Table(
        "rectangle",
        "rectangle:rows",
        {"costs": "rectangle.nc"},
        "What the rectangular stiffness costs, table",
        """For each pair and observable: its value with the rectangle and with the whole course,
        both by the energy method; what the course changes, by method; the spread between the
        methods; the verdict. Empty: no jump, or a distance.""",
    ),
    Drawing(
        "rectangle_figure.draw",
        {"costs": "rectangle.nc"},
        "rectangle",
        "What the rectangular stiffness costs",
        """Motion of the drawn pairs with the whole course of the stiffness, and with the
        rectangle of the same means in double and single contact; damping ratio
        {c.rectangle.damping_ratio}. Above: height of the orbit, speed rising and falling;
        tuning and static deflection are those of the energy method. Below: what the rectangle
        changes, a mark for each variant of the energy method in its colour, beside the spread
        between the rectangles of all methods; what is too small to be shown stands at the left
        edge. A difference up to the tolerance, {c.rectangle.tolerance}, is negligible; one
        below the spread is smaller than the uncertainty of the stiffness. Relative differences;
        of contact loss and of motions of another period those of shares.""",
    ),
    **_about("mesh_stiffness", bare=True),
)

DYNAMIC_FACTOR = Study(
    "dynamic_factor",
    DynamicFactor,
    DRAWN,
    Job(
        "dynamic_factor",
        "dynamic_factor:compute",
        lambda c: {
            "pair": _written(_one(c, "dynamic_factor")),
            "ratios": grid_of(c.dynamic_factor),
            "settings": without(c.dynamic_factor, "pair", *GRID),
        },
    ),
    Drawing(
        "dynamic_factor_figure.draw",
        {"factors": "dynamic_factor.nc"},
        "dynamic_factor",
        "Dynamic factor of drawn gears, beside ISO 6336-1",
        lambda c: (
            f"""Largest mesh force of two drawn gears over the static one, teeth
        {_one(c, "dynamic_factor").pinion.teeth} and {_one(c, "dynamic_factor").wheel.teeth},
        {_one(c, "dynamic_factor").torque} N m on the pinion, damping ratio
        {c.dynamic_factor.damping_ratio}: exact sweeps with speed up and down, beside the
        dynamic factor of ISO 6336-1, method B. Two ways to find the mesh stiffness. Perfect
        teeth, and teeth that deviate once in a mesh period by a cosine as high as the
        classes {_qualities(c)} of ISO 1328-1 allow after running in. Triangles: jumps;
        strips: contact is lost."""
        ),
    ),
    **_about("dynamic_factor", bare=True),
)

HARRIS_MAP = Study(
    "harris_map",
    HarrisMap,
    DRAWN,
    Job(
        "harris_map",
        "tip_relief:harris_map",
        lambda c: (
            {"gears": _written(_one(c, "harris_map"))}
            | c.harris_map.model_dump(include={"loads", "stiffness", "phases"})
        ),
        kernels=(),
    ),
    Drawing(
        "harris_map_figure.draw",
        {"data": "harris_map.nc"},
        "harris_map",
        "Tip relief: Harris maps",
        lambda c: (
            f"""Harris maps: the static transmission error of drawn spur gears over two mesh
        periods, at several loads, written over the design load of {_one(c, "harris_map").torque}
        N m (thick). Long relief begins where single contact ends and has the amounts of least
        peak-to-peak error at the design load; short relief has the same amounts on half of the
        length. Below: peak-to-peak error, and the effective contact ratio, the mean number of
        pairs of teeth that touch. No relief removes the variation of the error within single
        contact."""
        ),
    ),
    **_about("harris_map"),
)

RELIEF_DYNAMICS = Study(
    "relief_dynamics",
    ReliefDynamics,
    DRAWN,
    # Its own kernels are compiled by itself: no other job needs them.
    Job(
        "relief_dynamics",
        "tip_relief:dynamics",
        lambda c: {
            "gears": _written(_one(c, "harris_map")),
            "stiffness": c.harris_map.stiffness,
            "tunings": grid_of(c.relief_dynamics),
            "settings": without(c.relief_dynamics, *GRID),
        },
        kernels=("larger_kernels",),
    ),
    Drawing(
        "relief_dynamics_figure.draw",
        {"data": "relief_dynamics.nc"},
        "relief_dynamics",
        "Tip relief: dynamic force by two models",
        """The gears of the Harris map with long relief in motion, at several loads over the
        design load, sweeping up and down in speed. Wide: one degree of freedom with stiffness
        and deviation at the load. Thin: pairs of teeth that touch one by one, each with its own
        flank line, exact between events. Shaded: a model loses contact. The small model
        suffices where the largest dynamic forces differ by at most
        {c.relief_dynamics.tolerance} of the force at all tunings.""",
    ),
    **_about("harris_map"),
)

"""Studies of drawn gears: mesh stiffness, Harris maps."""

from gearlib.config import gear_names
from gearlib.config.stiffness_section import HarrisMap, MeshStiffness, PublishedPair
from gearlib.config.studies.study import (
    DRAWN,
    Drawing,
    Job,
    Study,
    Table,
)

#: Section -> its key of drawn gears.
_KEYS = {"mesh_stiffness": "pairs", "harris_map": "gears"}


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


def _refusal(section):
    """Return the function of the configuration that says why a section cannot take its gears."""

    def refusal(c):
        if _takes_own(c, section):
            try:
                getattr(c, section).check_gears("gears", _one(c, section))
            except ValueError as error:
                return str(error)
        return ""

    return refusal


def _about(section):
    """Return what a study says of the gears of a section."""
    return {"gears": _names(section), "refusal": _refusal(section)}


def _pairs(c):
    return {name: pair.model_dump() for name, pair in drawn(c, "mesh_stiffness").items()}


def _unrelieved(c):
    relieved = c.gears and c.gears.relief() and _takes_own(c, "mesh_stiffness")
    return " All of involutes, without tip relief or errors of teeth." if relieved else ""


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

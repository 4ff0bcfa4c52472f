"""Studies of gear trains: the reducer, its Campbell diagram, a train over speed."""

from typing import get_args

from gearlib.config import gear_names
from gearlib.config.reducer_section import Campbell, Reducer
from gearlib.config.studies.study import (
    EXPLANATIONS,
    GRID,
    STARTS,
    TRAINS,
    Drawing,
    Job,
    Study,
    Table,
    grid_of,
    listed,
    without,
)
from gearlib.config.train_section import OF_PAIRS, Train, TrainSweep

_TRAIN = ("train_kernels",)
#: Asks for a train.
NO_TRAIN = (
    "train is missing: it must be a section of the configuration, whose kind is one of "
    f"{', '.join(get_args(Train.model_fields['kind'].annotation))}"
)


#: What the schematic of a train is, in a caption.
_SEEN = "Beside: the train along its axes, pitch circles and shafts grey, a dot at each mesh"


def _displaced(c):
    """Return the displacement of a satellite in words."""
    return " m radially, ".join(map(str, c.reducer.pin_error)) + " m tangentially"


def _pair(c):
    return c.pair_parameters(c.reducer.damping)


def has_own_train(c):
    """Return whether the section `train` is about another train than the paper's reducer."""
    return c.train.kind != "split_power_reducer" or bool(_given(c.train.split_power_reducer))


def _given(section):
    """Return the keys that a section of a train gives."""
    return [key for key, value in dict(section).items() if value is not None]


def _without_teeth(c):
    """Say why the reducer of the configuration cannot be made of its gears."""
    if c.train.kind != "split_power_reducer":
        return f"train.kind = {c.train.kind!r} is not allowed: it must be split_power_reducer"
    for key in _given(c.train.split_power_reducer):
        return (
            f"train.split_power_reducer.{key} is not allowed: it must be left out, and what "
            "the reducer is stand in the section reducer"
        )
    if c.gears and "teeth" not in c.reducer.model_fields_set:
        return "reducer.teeth is missing: it must be given where the gears are drawn"
    return ""


def _train_without_teeth(c):
    """Say why the train of the configuration cannot be made of its gears."""
    of_pairs = c.train.kind in OF_PAIRS
    if c.gears and of_pairs and getattr(c.train, c.train.kind).teeth is None:
        return f"train.{c.train.kind}.teeth is missing: it must be given where the gears are drawn"
    return ""


def undamped(c):
    """Return the sentence that asks for the damping of a train whose gears move, or ""."""
    train, key = c.train, ""
    if train.kind == "planetary_set" and not _has_damping(train.planetary_set):
        key = "planetary_set.damping_ratio"
    for i, mesh in enumerate(train.own.meshes if train.kind == "own" else ()):
        if not key and not _has_damping(mesh):
            drawn = mesh.max_stiffness is None
            key = f"own.meshes[{i}].{'damping_ratio' if drawn else 'material_damping'}"
    return key and f"train.{key} is missing: it must be given where gears move, 0 included"


def _has_damping(section):
    names = ("damping_ratio", "logarithmic_decrement", "material_damping")
    return any(getattr(section, name) is not None for name in names)


REDUCER = Study(
    "reducer",
    Reducer,
    EXPLANATIONS,
    Job(
        "reducer",
        "trains.reducer:compute",
        lambda c: {
            "pair": _pair(c),
            "tunings": grid_of(c.reducer),
            "settings": without(c.reducer, "damping", *GRID),
        },
        kernels=_TRAIN,
    ),
    Table(
        "reducer",
        "trains.reducer:rows",
        {"characteristics": "reducer.nc"},
        "Fig. 1: the reducer, table",
        """For each case, direction of the sweep and mesh of the reducer: the largest dynamic
        factor of the motions on which all starts settle, where it lies, and the tunings at
        which from all starts contact is lost, or a far flank struck, in its branch only. Last:
        the tunings at which starts do not end on one stable orbit; there the figure has the
        range. *cold*: all starts beside static equilibrium; *up*, *down*: one start carried.""",
    ),
    Drawing(
        "reducer_figure.draw",
        {"characteristics": "reducer.nc"},
        "reducer",
        "Fig. 1: all meshes of the reducer over speed",
        lambda c: (
            f"""The reducer with double satellites, every mesh a pair with damping
        {c.reducer.damping}, teeth {listed(c.reducer.teeth)}: largest mesh forces over
        static ones, and how the branches share the load, over the tuning of the pair alone
        and the speed. Every tuning has {c.reducer.starts} seeded starts, up to
        {c.reducer.spread} static deflections beside static equilibrium. Lines: where all of
        them end on one stable orbit, that; else medians, with their range as shade and the
        shares of the starts in the lowest row. Below the panels: the train along its axes,
        pitch circles and shafts grey, meshes in the colours of their branches. Triangles: the
        first start carried up and down, where it settles on another orbit. Squares and
        crosses: all starts. Middle: the axis of one satellite displaced by {_displaced(c)}.
        Right: backlash of the branches {listed(c.reducer.backlashes)} m. Record of the last
        {c.reducer.record_periods} of {c.reducer.periods} mesh periods."""
        ),
    ),
    gears=gear_names.of_reducer,
    refusal=_without_teeth,
)


def _in_campbell(c):
    if has_own_train(c):
        return {"train": c.train_parameters(c.train_sweep.damping), "orders": c.campbell.orders}
    settings = without(c.reducer, "damping", *GRID, *STARTS)
    return {"pair": _pair(c), "settings": settings, "orders": c.campbell.orders}


def _of_campbell(c):
    """Return the words for the train of the Campbell diagram."""
    if has_own_train(c):
        return f"the train of the section ``train``, {c.train.kind.replace('_', ' ')}"
    damping = c.reducer.damping
    return f"the reducer whose branches are alike, every mesh a pair with damping {damping}"


CAMPBELL = Study(
    "campbell",
    Campbell,
    EXPLANATIONS,
    Job(
        "campbell",
        "trains.campbell:compute",
        _in_campbell,
        {"characteristics": lambda c: f"{'train_sweep' if has_own_train(c) else 'reducer'}.nc"},
        kernels=(),
    ),
    Table(
        "campbell",
        "trains.campbell:rows",
        {"diagram": "campbell.nc"},
        "Campbell diagram, table",
        lambda c: (
            f"""Intersections of the Campbell diagram of {_of_campbell(c)}, up to the fastest speed
        swept; modes of one frequency are one row. Orders count over the first mesh frequency."""
        ),
    ),
    Drawing(
        "campbell_figure.draw",
        {"diagram": "campbell.nc"},
        "campbell",
        "Campbell diagram",
        lambda c: (
            f"""Campbell diagram of {_of_campbell(c)}: natural frequencies at mean stiffness against
        the mesh frequencies and their orders up to {c.campbell.orders}, labelled with the order
        over the first mesh frequency. Dots: the mesh stiffness excites the mode, circles: it does
        not, because the phases of the meshes cancel or no mesh deforms in the mode. Yellow, behind
        a mesh frequency: a mesh of it loses contact in an exact sweep, from all starts, or carried
        with speed up or down. """
            + f"{_SEEN}."
        ),
    ),
    gears=lambda c: gear_names.of_train(c) if has_own_train(c) else gear_names.of_reducer(c),
    refusal=lambda c: _train_without_teeth(c) if has_own_train(c) else _without_teeth(c),
)

TRAIN_SWEEP = Study(
    "train_sweep",
    TrainSweep,
    TRAINS,
    Job(
        "train_sweep",
        "trains.over_speed:compute",
        lambda c: {
            "train": c.train_parameters(c.train_sweep.damping),
            "tunings": grid_of(c.train_sweep),
            "settings": without(c.train_sweep, "damping", *GRID),
        },
        kernels=_TRAIN,
    ),
    Drawing(
        "train_sweep_figure.draw",
        {"curves": "train_sweep.nc"},
        "train_sweep",
        "The train of the configuration over speed",
        lambda c: (
            f"""The train of the section ``train``, {c.train.kind.replace("_", " ")}:
        largest force of every mesh over its static one, and the share of time for which its
        drive flanks touch, over the speed. Lines: one start carried up and down from static
        equilibrium, where it settles on a stable orbit. Shades: the range of
        {c.train_sweep.starts} seeded starts, up to {c.train_sweep.spread} static
        deflections beside equilibrium, where they do not end on one orbit, dots their
        medians; below, their shares. Record of the last {c.train_sweep.record_periods} of
        {c.train_sweep.periods} mesh periods. {_SEEN} in the colour of its lines."""
        ),
    ),
    # By default the train is the reducer, which has a target.
    unasked=False,
    gears=gear_names.of_train,
    refusal=lambda c: (
        _train_without_teeth(c) or ("" if "train" in c.model_fields_set else NO_TRAIN)
    ),
)

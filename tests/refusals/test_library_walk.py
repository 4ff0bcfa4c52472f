"""A walk over the parameters of the public constructors and calls: just outside and just inside.

What each may be is said by `ranges.yaml`; a parameter without a row there is missed.
"""

import inspect

import pytest
import xarray as xr

import gearlib
import gearlib.geometry as drawn
from gearlib import Body, GearPair, Harmonics, LoadSharingPair
from gearlib.parameters import Number, declared_parameters
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER, PARAMETERS
from tests.refusals.ranges import Ranges

RANGES, UNITS = Ranges("library"), Ranges("units")
NU = 0.9
DAMPED = PAPER.replace(material_damping=4e3)
ORBIT = gearlib.periodic_orbit(DAMPED, NU)
FZG, GEAR = fzg_c(quality=5), {"teeth": 20, "module": 4e-3, "width": 0.02}
SUN, PLANET = (drawn.SpurGear(teeth=z, module=3e-3, width=0.025) for z in (27, 36))
RING = drawn.SpurGear(teeth=99, module=3e-3, width=0.025, internal=True, outer_diameter=0.34)
A = {"name": "a", "inertia": 0.01, "base_radius": 0.1, "teeth": 20, "mass": 1.0, "torque": 100.0}
B = {"name": "b", "inertia": 0.02, "base_radius": 0.2, "teeth": 40, "torque": 200.0}
AB = dict(pinion="a", wheel="b", max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.5)
TABLE = {"phase": (0.0, 1.0), "stiffness": (1.0, 2.0)}


def branch():
    """Return the branch of a gear pair, its first point called a doubling."""
    found = gearlib.continue_orbit(ORBIT, to=NU + 0.01, max_points=3)
    found.label[0] = 2
    return {"pair": DAMPED, "branch": found, "point": 0}


BRANCH = branch()
RUN_UP = gearlib.run_up(PAPER, 1000.0, 1100.0, duration=0.2, samples_per_period=64)
JUMP = xr.Dataset({"jump_up": ((), 3300.0, {"units": "min-1", "noise_std": 1.0})})
#: What is made at once: also asked just inside the ranges.
MADE = {
    GearPair: PARAMETERS,
    GearPair.from_ratios: {"contact_ratio": 1.5, "stiffness_ratio": 0.6},
    gearlib.OneDegreePair: {"pair": PAPER},
    gearlib.SixDegreePair: {
        **{"pair": PAPER, "base_radii": (0.1, 0.1), "inertias": (0.06, 0.06)},
        **{"masses": (17.0, 17.0), "bearing_stiffness": (1e8,) * 4},
    },
    gearlib.DeadZoneOscillator: {"upper_stiffness": 1.0},
    LoadSharingPair: {"pair": PAPER, "drawing": FZG},
    Body: A,
    gearlib.Shaft: {"bodies": ("a", "b"), "stiffness": 1.0},
    gearlib.Mesh: AB,
    gearlib.GearTrain: {"bodies": (Body(**A), Body(**B)), "meshes": (gearlib.Mesh(**AB),)},
    Harmonics: {},
    gearlib.Fourier: {"harmonics": 3},
    gearlib.Series: {"mean": 1.0, "harmonics": Harmonics()},
    gearlib.Steps: TABLE,
    gearlib.Tabulated: TABLE,
    gearlib.planetary: {},
    gearlib.idler: {"pair": PAPER},
    gearlib.two_stage: {"pair": PAPER},
    gearlib.split_power_reducer: {"pair": PAPER},
    drawn.Material: {},
    drawn.Rack: {},
    drawn.Web: {"thickness": 0.01, "rim_diameter": 0.06, "hub_diameter": 0.04},
    drawn.TipRelief: {"amount": 1e-5, "length": 1e-3},
    drawn.PathTable: {"position": (0.0,), "value": (0.0,)},
    drawn.SpurGear: GEAR,
    drawn.Mesh: {"pinion": drawn.SpurGear(**GEAR), "wheel": drawn.SpurGear(**GEAR)},
    drawn.planetary_set: {"sun": SUN, "planet": PLANET, "ring": RING, "torque": 100.0},
    drawn.dynamic_factor: {"mesh": FZG, "torque": 300.0, "rpm": 100.0},
    drawn.iso_stiffness: {"mesh": FZG},
}
FOLLOWED = {"model": DAMPED, "tolerances": {"load": {"std": "1 %"}}, "n": 2, "speed": 3000.0}
CALLED = {
    LoadSharingPair.from_geometry: {"mesh": FZG, "torque": 1.0},
    drawn.mesh_stiffness: {"mesh": FZG, "method": "energy"},
    drawn.optimum_relief: {"mesh": FZG, "torque": 300.0},
    drawn.Mesh.transmission_error: {"self": FZG, "torque": 300.0},
    gearlib.simulate: {"pair": PAPER, "tuning": NU, "periods": 2},
    gearlib.sweep: {"pair": PAPER, "tunings": [NU], "periods": 2, "record_periods": 1},
    gearlib.run_up: {"model": PAPER, "start": 1000.0, "stop": 1100.0, "duration": 0.05},
    gearlib.basins: {"pair": DAMPED, "tuning": NU, "grid": ([0.0], [0.0]), "periods": 60},
    gearlib.basin_stability: {
        **{"pair": DAMPED, "tunings": [NU], "region": ((-1.0, 1.0), (-1.0, 1.0))},
        **{"samples": 1, "periods": 60},
    },
    gearlib.bifurcation_diagram: {"pair": PAPER, "values": [NU], "settle": 2, "strobes": 4},
    gearlib.poincare_section: {"pair": PAPER, "tuning": NU, "states": [(0.0, 0.0)], "periods": 2},
    gearlib.lyapunov_exponents: {"pair": PAPER, "values": [NU], "settle": 2, "periods": 20},
    gearlib.trust: {"pair": PAPER, "tuning": NU, "periods": 200, "exponent_periods": 20},
    gearlib.periodic_orbit: {"pair": DAMPED, "tuning": NU},
    gearlib.continue_orbit: {"orbit": ORBIT, "to": NU + 0.01, "max_points": 3},
    gearlib.sensitivities: {
        **{"call": lambda model, tuning: model.load * tuning, "model": PAPER},
        **{"parameters": ("load",), "tuning": NU},
    },
    gearlib.switch_branch: BRANCH,
    gearlib.locus: BRANCH | {"parameter": "damping", "to": 0.1},
    gearlib.tongues: {"pair": PAPER, "start": 0.9, "stop": 1.1, "step": 0.05},
    gearlib.schmidt: {"pair": DAMPED, "tuning": NU, "harmonics": 16},
    gearlib.duty_point: {"gears": FZG, "speed": 3000.0, "torque": 300.0, "damping_ratio": 0.05},
    gearlib.orders: {"run": gearlib.simulate(DAMPED, NU, periods=24, record_periods=24)},
    gearlib.order_map: {"run": RUN_UP},
    gearlib.harmonic_balance: {"pair": DAMPED, "tuning": NU, "harmonics": 16},
    gearlib.read_measured: {"path": ""},
    gearlib.scatter: {
        **{"model": PAPER, "tolerances": {"load": {"std": "1 %"}}, "n": 2, "quantities": ()},
        **{"tunings": [NU], "periods": 2, "record_periods": 1},
    },
    gearlib.sobol_indices: FOLLOWED | {"quantities": ("force",)},
    gearlib.fit: {"model": DAMPED, "data": JUMP, "free": {"reduced_mass": (3.0, 3.2)}},
}
#: What says the same in another way.
INSTEAD = {"speed": "tuning", "speeds": "tunings"}
#: Who is called differently where it is handed on to.
HANDED_ON = {
    "mesh_stiffness.method": "stiffness",
    "planetary_set.sun": "pinion of the sun mesh",
    "planetary_set.planet": "wheel of the sun mesh",
}
#: What no range tells: any truth; what a search asks first whether it can go on at all; what only
#: counts beside another; what is refused together with others, in `combinations`.
FREE = """
locus.limits locus.max_points locus.to continue_orbit.to tongues.values
sensitivities.call sensitivities.parameters sensitivities.arguments
SpurGear.tip_diameter planetary_set.ring schmidt.degenerate
dynamic_factor.rpm lyapunov_exponents.states
order_map.tacho
scatter.speed scatter.box scatter.progress
sobol_indices.speed sobol_indices.progress
run_up.speed run_up.load run_up.acceleration run_up.driver run_up.base_radius
""".split()


def owner(call):
    name = call.__qualname__.replace("Mesh.transmission", "transmission")
    return f"geometry.{name}" if call is drawn.Mesh else name


def parameters(calls):
    """Yield (call, arguments, parameter) of all that is not free."""
    for call, good in calls.items():
        for one in inspect.signature(call).parameters.values():
            if one.kind != one.VAR_KEYWORD and one.name != "self":
                if f"{owner(call)}.{one.name}" not in FREE:
                    yield call, good, one


def wrong(one, found):
    """Yield (value, shown value, what is allowed) for a parameter."""
    if one.default is one.empty:
        yield None, None, found
    if found.count != 0:
        # Another length, and an entry.
        count, right = found.count or 1, found.entry.inside()[0]
        if found.count:
            yield from ((value, value, found) for value in (7, (right,) * (count + 1)))
        if found.entry.numeric:
            for value in ("fast", *found.entry.outside()):
                yield (right,) * (count - 1) + (value,), value, found.entry
    elif found.numeric:
        yield from ((value, value, found) for value in ("fast", True, *found.outside()))
    else:
        only = found.words in ("a text", "a sequence")
        yield from ((value, value, found) for value in ("wrong", 7)[only:])


def core(found):
    """Return what a sentence has to say of a range."""
    if found.count:
        return str(found.count)
    words = found.words.removeprefix("a finite number ")
    words = words.removeprefix("a number ").split(" or infinity")[0]
    return {"a finite number": "finite"}.get(words, words if found.count == 0 else "")


@pytest.mark.parametrize(
    ("call", "good", "one"),
    [pytest.param(*row, id=f"{owner(row[0])}.{row[2].name}") for row in parameters(MADE | CALLED)],
)
def test_each_wrong_value_is_refused_in_one_sentence(call, good, one):
    key = f"{owner(call)}.{one.name}"
    found = RANGES.of(key.split("."))
    assert found, "no row of ranges.yaml"
    others = {name: value for name, value in good.items() if name != INSTEAD.get(one.name)}
    for value, shown, allowed in wrong(one, found):
        with pytest.raises(ValueError) as refusal:
            call(**others | {one.name: value})
        text = str(refusal.value)
        begin, _, end = text.partition(" is not allowed: it must be ")
        assert begin.startswith(HANDED_ON.get(key, one.name)), text
        assert repr(shown) in begin or type(shown).__name__ in begin, text
        assert core(allowed) in end, (text, allowed.words)
        assert "\n" not in text and ". " not in text and len(text) < 500


@pytest.mark.parametrize(
    ("call", "good", "one"),
    [pytest.param(*row, id=f"{owner(row[0])}.{row[2].name}") for row in parameters(MADE)],
)
def test_what_is_just_inside_is_allowed(call, good, one):
    found = RANGES.of([owner(call), one.name])
    many = found.count != 0
    entry = found.entry if many else found
    for value in entry.inside() if entry.numeric else ():
        try:
            call(**good | {one.name: (value,) * (found.count or 1) if many else value})
        except ValueError as refusal:
            # What does not go with the others says something else.
            assert not core(entry) or not str(refusal).endswith(core(entry)), str(refusal)


def test_no_call_is_left_out():
    public = {getattr(gearlib, name) for name in gearlib.__all__ if not name.startswith("certify")}
    public |= {getattr(drawn, name) for name in drawn.__all__ if name != "RACKS"}
    results = {drawn.DynamicFactor, drawn.IsoStiffness, drawn.MeshStiffness}
    assert public - results - {gearlib.methods, gearlib.Rectangular} <= {*MADE, *CALLED}


def test_what_is_declared_has_its_unit():
    found = [
        (call, name, one)
        for call in (*MADE, *CALLED)
        for name, one in declared_parameters(call).items()
        if isinstance(innermost(one.kind), Number)
    ]
    assert len(found) > 100
    for call, name, one in found:
        unit = UNITS.of([owner(call), name])
        assert unit and (one.unit or "1") == unit.words, (owner(call), name)
    with pytest.raises(TypeError, match="unit"):
        Number(gt=0)  # type: ignore[call-arg]


def innermost(kind):
    """Return the kind of the values of a list, of a list of lists."""
    return innermost(kind.item) if hasattr(kind, "item") else kind


@pytest.mark.parametrize("kind", [drawn.Material, drawn.Rack, drawn.SpurGear, drawn.Web])
def test_parts_of_a_drawing_take_their_values_by_name(kind):
    with pytest.raises(TypeError, match="positional"):
        kind(0.01, 0.06, 0.04)

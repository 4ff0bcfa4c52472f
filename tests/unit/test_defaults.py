"""What a configuration leaves out: the defaults, and that config.yaml shows them."""

import pytest

from gearlib import GearPair, SixDegreePair
from gearlib.config import load
from gearlib.config.gears_section import TWENTY
from tests.paper import CONFIG

GEARS = {
    "max_stiffness": 3.1e8,
    "stiffness_ratio": 0.62,
    "contact_ratio": 1.47,
    "reduced_mass": 0.85,
    "load": 2400.0,
    "backlash": 60e-6,
    "teeth": 31,
}


def coefficients(material, backlash):
    """Return a damping of the configuration."""
    return {"material_damping": material, "backlash_damping": backlash}


#: What suits the paper's gears only, or is a choice of the scenes: config.yaml differs there.
OWN = {
    "phase_lag.material_dampings",
    "jump.marked",
    "six_degrees.inertias",
    "six_degrees.masses",
    "six_degrees.bearing_damping",
    "six_degrees.eccentricities",
    "work_precision.methods",  # the order of the columns
    "work_precision.cubic_damping",
    "basins.cases",
    "basins.periods",
    "bifurcation.damping",
    "poincare.cases",
    "scenes",
}


def differences(one, other, path=""):
    """Return the keys, one level below the sections, in which two configurations differ."""
    found = set()
    for key in one:
        here = f"{path}{key}"
        inside = isinstance(one[key], dict) and not path and key != "scenes"
        if inside:
            found |= differences(one[key], other[key], f"{here}.")
        elif one[key] != other[key]:
            found.add(here)
    return found


def test_the_configuration_of_the_project_shows_the_defaults():
    paper = load({key: CONFIG[key] for key in ("gear_pair", "dampings")})
    assert differences(load(CONFIG).model_dump(), paper.model_dump()) == OWN
    ours, theirs = (c.work_precision.methods for c in (load(CONFIG), paper))
    assert sorted(ours) == sorted(theirs)


@pytest.mark.parametrize("backlash", [0.0, 60e-6, float("inf")])
@pytest.mark.parametrize(
    "dampings",
    [
        {"none": coefficients(0.0, 0.0)},
        {"none": coefficients(0.0, 0.0), "oil": coefficients(0.0, 20.0)},
        {f"k{i}": coefficients(100.0 * (i + 1), 1.0) for i in range(30)},
    ],
)
def test_the_gears_alone_are_a_configuration(backlash, dampings):
    config = load({"gear_pair": GEARS | {"backlash": backlash}, "dampings": dampings})
    damped = [name for name, d in dampings.items() if any(d.values())]
    assert config.jump.damping == (damped or ["none"])[0]
    largest = config.nonlinear_damping.damping
    assert largest == max([one for d in dampings.values() for one in d.values()]) or largest > 0.0
    assert config.phase_lag.material_dampings == [largest, largest / 100.0]
    # All motions settle only where contact is damped: of the first such one, or of none of these.
    settling = [d["material_damping"] for d in dampings.values() if d["material_damping"]]
    shown = config.bifurcation.damping.material_damping
    assert shown == settling[0] if settling else shown > 0.0
    assert set(config.figures.colours) == set(dampings)
    assert len(set(config.figures.colours.values())) == min(8, len(dampings))
    name = next(iter(dampings))
    pair = GearPair(**config.pair_parameters(name))
    six = SixDegreePair(pair=pair, **config.six_degrees.model_dump())
    assert six.pair.reduced_mass == pair.reduced_mass


def test_default_bodies_have_the_reduced_mass_of_the_pair():
    # Along the line of action both rotations and both bearings yield.
    config = load({"gear_pair": GEARS, "dampings": {"a": coefficients(1.0, 0.0)}})
    bodies = config.six_degrees
    rotations = zip(bodies.base_radii, bodies.inertias, strict=True)
    compliance = sum(r * r / j for r, j in rotations) + sum(1.0 / m for m in bodies.masses)
    assert 1.0 / compliance == pytest.approx(GEARS["reduced_mass"], rel=1e-12)


def test_the_default_resonance_of_drawn_gears_holds_their_speed():
    damping = {"a": {"damping_ratio": 0.05, "backlash_damping_ratio": 0.0}}
    for speed in (1000.0, 1e5):
        config = load({"gears": TWENTY | {"speed": speed}, "dampings": damping})
        section = config.resonance
        tuning = GearPair(**config.pair_parameters("a")).tuning_at(speed)
        assert section.start <= tuning <= section.stop and section.lowest < section.start
    own = {"resonance": {"start": 0.6}, "gears": TWENTY | {"speed": 1000.0}, "dampings": damping}
    assert load(own).resonance.start == 0.6 and load(own).resonance.lowest is None


def test_what_is_given_stays():
    given = {
        "gear_pair": GEARS,
        "dampings": {
            "a": coefficients(1.0, 0.0),
            "b": coefficients(2.0, 0.0),
        },
        "jump": {"damping": "b"},
        "resonance": {"stop": 1.2},
        "bifurcation": {"damping": coefficients(5.0, 6.0)},
        "figures": {"colours": {"b": "#0072b2"}},
    }
    config = load(given)
    assert config.jump.damping == "b" and config.analytic_method.damping == "a"
    assert (config.resonance.start, config.resonance.stop) == (0.5, 1.2)
    assert config.bifurcation.damping.backlash_damping == 6.0
    assert config.figures.colours["b"] == "#0072b2"
    assert config.figures.colours["a"] not in ("#0072B2", "#0072b2")

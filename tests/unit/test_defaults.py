"""What a configuration leaves out: the defaults, and that config.yaml shows them."""

import pytest

from gearlib import GearPair, SixDegreePair
from gearlib.config import load
from tests.paper import CONFIG

GEARS = {"max_stiffness": 3.1e8, "stiffness_ratio": 0.62, "contact_ratio": 1.47}
GEARS |= {"reduced_mass": 0.85, "load": 2400.0, "backlash": 60e-6, "teeth": 31}
#: Keys and sections whose values in config.yaml suit the paper's gears only: not the defaults.
PAPER_SPECIFIC = set(
    """
    phase_lag.material_dampings jump.marked six_degrees.inertias six_degrees.masses
    six_degrees.bearing_damping six_degrees.eccentricities work_precision.methods
    work_precision.cubic_damping basins.cases basins.periods bifurcation.damping poincare.cases
    scenes
    """.split()
)


def coefficients(material, backlash):
    """Return a damping of the configuration."""
    return {"material_damping": material, "backlash_damping": backlash}


def test_config_yaml_shows_the_defaults():
    defaults = load({key: CONFIG[key] for key in ("gear_pair", "dampings")}).model_dump()
    different = set()
    for name, section in load(CONFIG).model_dump().items():
        if isinstance(section, dict) and name != "scenes":
            other = defaults[name]
            different |= {f"{name}.{key}" for key in section if section[key] != other[key]}
        elif section != defaults[name]:
            different.add(name)
    assert different == PAPER_SPECIFIC
    # The methods differ from the default in their order only.
    methods = CONFIG["work_precision"]["methods"]
    assert sorted(methods) == sorted(defaults["work_precision"]["methods"])


@pytest.mark.parametrize("backlash", [0.0, 60e-6, float("inf")])
@pytest.mark.parametrize(
    "dampings",
    [
        {"none": coefficients(0.0, 0.0)},
        {"none": coefficients(0.0, 0.0), "oil": coefficients(0.0, 20.0)},
        {f"k{i}": coefficients(100.0 * (i + 1), 1.0) for i in range(30)},
    ],
)
def test_defaults_follow_from_gears_and_dampings(backlash, dampings):
    settings = load({"gear_pair": GEARS | {"backlash": backlash}, "dampings": dampings})
    assert load(settings.model_dump()) == settings
    damped = [name for name, k in dampings.items() if any(k.values())]
    assert settings.jump.damping == (damped or ["none"])[0]
    largest = settings.nonlinear_damping.damping
    highest = max(max(k.values()) for k in dampings.values())
    assert largest == highest or highest == 0.0 < largest
    assert settings.phase_lag.material_dampings == [largest, largest / 100.0]
    # Motions settle where contact is damped: the diagram takes the first such damping, or its own.
    settling = [k["material_damping"] for k in dampings.values() if k["material_damping"]]
    damping = settings.bifurcation.damping.material_damping
    assert damping == settling[0] if settling else damping > 0.0
    assert set(settings.figures.colours) == set(dampings)
    assert len(set(settings.figures.colours.values())) == min(8, len(dampings))
    # The default bodies of six degrees of freedom have the reduced mass of the pair.
    pair = GearPair(**settings.pair_parameters(next(iter(dampings))))
    six = SixDegreePair(pair=pair, **settings.six_degrees.model_dump())
    assert six.reduced_mass_free == pytest.approx(GEARS["reduced_mass"], rel=1e-12)

"""What a configuration leaves out: the defaults, and that config.yaml shows them."""

import pytest

from gearlib import GearPair, SixDegreePair
from gearlib.config import load
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
#: What suits the paper's gears only, or is a choice of the scenes: config.yaml differs there.
PAPERS = set(
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


def test_the_configuration_of_the_project_shows_the_defaults():
    paper = load({key: CONFIG[key] for key in ("gear_pair", "dampings")})
    first, second = load(CONFIG).model_dump(), paper.model_dump()
    different = set()
    for name, section in first.items():
        if isinstance(section, dict) and name != "scenes":
            keys = [key for key in section if section[key] != second[name][key]]
            different |= {f"{name}.{key}" for key in keys}
        elif section != second[name]:
            different.add(name)
    assert different == PAPERS
    # Of these the order of the columns alone.
    assert sorted(load(CONFIG).work_precision.methods) == sorted(paper.work_precision.methods)


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
    settings = load({"gear_pair": GEARS | {"backlash": backlash}, "dampings": dampings})
    assert load(settings.model_dump()) == settings
    damped = [name for name, k in dampings.items() if any(k.values())]
    assert settings.jump.damping == (damped or ["none"])[0]
    largest = settings.nonlinear_damping.damping
    highest = max(value for k in dampings.values() for value in k.values())
    assert largest == highest or highest == 0.0 < largest
    assert settings.phase_lag.material_dampings == [largest, largest / 100.0]
    # All motions settle only where contact is damped: of the first such one, or of none of these.
    settling = [k["material_damping"] for k in dampings.values() if k["material_damping"]]
    shown = settings.bifurcation.damping.material_damping
    assert shown == settling[0] if settling else shown > 0.0
    assert set(settings.figures.colours) == set(dampings)
    assert len(set(settings.figures.colours.values())) == min(8, len(dampings))
    # Along the line of action both rotations and both bearings of the default bodies yield.
    pair = GearPair(**settings.pair_parameters(next(iter(dampings))))
    six = SixDegreePair(pair=pair, **settings.six_degrees.model_dump())
    assert six.reduced_mass_free == pytest.approx(GEARS["reduced_mass"], rel=1e-12)

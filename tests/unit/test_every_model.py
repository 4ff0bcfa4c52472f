"""Every public call with every model: it works, or says in one sentence why it does not."""

import math
import re

import numpy as np
import pytest

import gearlib
from gearlib import (
    DeadZoneOscillator,
    GearPair,
    Harmonics,
    OneDegreePair,
    SixDegreePair,
    basin_stability,
    basins,
    bifurcation_diagram,
    continue_orbit,
    harmonic_balance,
    locus,
    lyapunov_exponents,
    periodic_orbit,
    poincare_section,
    schmidt,
    simulate,
    sweep,
    switch_branch,
    tongues,
    trust,
)
from tests.paper import PAPER
from tests.physics.test_dead_zone import as_oscillator

NU, BOX = 0.9, (-1.0, 1.0)
DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
#: Rigid bearings: two coordinates without the free rotation, of which trapping ellipses are found
#: soon.
RIGID = SixDegreePair(
    pair=DAMPED,
    base_radii=(0.1, 0.1),
    inertias=(0.06246, 0.06246),
    masses=(17.0, 17.0),
    bearing_stiffness=(math.inf,) * 4,
)
MODELS = {
    "gear pair": DAMPED,
    "one degree": OneDegreePair(pair=DAMPED, backlash_cubic_damping=4e5),
    "six degrees": RIGID,
    "run-out": RIGID.replace(eccentricities=(1e-6, 1e-6), teeth=(3, 2)),
    "oscillator": DeadZoneOscillator(
        lower_edge=-4.0,
        upper_stiffness=1.0,
        damping=0.1,
        load=1.0,
        forcing=Harmonics((0.5,)),
    ),
    "number": 7,
}


def orbit(pair):
    return periodic_orbit(pair, NU, period=getattr(pair, "repeats", 1))


def branch_and_point():
    """Return the branch of a gear pair, its first point called a doubling."""
    branch = continue_orbit(orbit(DAMPED), to=NU + 0.01, max_points=3)
    branch.label[0] = 2
    return branch, 0


CALLS = {
    "simulate": lambda pair: simulate(pair, NU, periods=2),
    "sweep": lambda pair: sweep(pair, [NU], periods=2, record_periods=1, direction="up"),
    "basins": lambda pair: basins(pair, NU, ([0.0], [0.0]), periods=60),
    "basin_stability": lambda pair: basin_stability(pair, [NU], (BOX, BOX), samples=1, periods=60),
    "bifurcation_diagram": lambda pair: bifurcation_diagram(pair, [NU], settle=2, strobes=4),
    "poincare_section": lambda pair: poincare_section(pair, NU, [(0.0, 0.0)], periods=2),
    "lyapunov_exponents": lambda pair: lyapunov_exponents(pair, [NU], settle=2, periods=20),
    "trust": lambda pair: trust(pair, NU, periods=200, exponent_periods=20),
    "periodic_orbit": lambda pair: orbit(pair).dataset(),
    "continue_orbit": lambda pair: continue_orbit(orbit(pair), to=NU + 0.01, max_points=3),
    "switch_branch": lambda pair: switch_branch(pair, *branch_and_point()),
    "locus": lambda pair: locus(pair, *branch_and_point(), "damping", to=0.1),
    "tongues": lambda pair: tongues(pair, start=0.9, stop=1.1, step=0.05),
    "schmidt": lambda pair: schmidt(pair, NU, harmonics=16, max_iterations=20).dataset(),
    "harmonic_balance": lambda pair: harmonic_balance(pair, NU, harmonics=16).dataset(),
}
#: What a call does not take beside the number; one branch serves those of one kind only.
REFUSED = {
    "continue_orbit": {"oscillator"},
    "tongues": {"oscillator"},
    "schmidt": {"six degrees", "run-out", "oscillator"},
    "harmonic_balance": {"six degrees", "run-out", "oscillator"},
}
BRANCHES = {"switch_branch", "locus"}
#: Words of a gear mesh, which an oscillator has not.
MESH = re.compile("mesh|static deflection|flank|dtau")


def test_no_public_call_is_left_out():
    models = {"DeadZoneOscillator", "GearPair", "OneDegreePair", "SixDegreePair"}
    parts = {"Fourier", "Harmonics", "Rectangular", "Series", "Steps", "Tabulated"}
    assert set(CALLS) == set(gearlib.__all__) - models - parts - {"methods"}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("call", [name for name in CALLS if name not in BRANCHES])
def test_it_works_or_says_why_not(call, model):
    pair = MODELS[model]
    if model == "number" or model in REFUSED.get(call, ()):
        with pytest.raises(ValueError, match="not allowed") as error:
            CALLS[call](pair)
        message = str(error.value)
        assert type(pair).__name__ in message or repr(pair) in message
        assert "\n" not in message and ". " not in message
        return
    found = CALLS[call](pair)
    dataset = getattr(found, "runs", found)
    if model == "oscillator":
        texts = [dataset.attrs["title"]]
        texts += [str(one.attrs.get("long_name")) for one in dataset.variables.values()]
        assert not [text for text in texts if MESH.search(text)]


@pytest.mark.parametrize("call", sorted(BRANCHES))
@pytest.mark.parametrize("model", ["oscillator", "number"])
def test_branches_are_those_of_gears(call, model):
    with pytest.raises(ValueError, match="pair = .* is not allowed: it must be a GearPair"):
        CALLS[call](MODELS[model])


def test_an_oscillator_without_damping_has_no_basins():
    free = MODELS["oscillator"].replace(damping=0.0, lower_edge=-math.inf, lower_damping=0.3)
    with pytest.raises(ValueError, match="without any damping"):
        basins(free, NU, ([0.0], [0.0]))
    found = basins(free.replace(upper_damping=0.1), NU, ([0.0], [0.0]), periods=60)
    assert int(found.attractor_kind[0]) == 0


def test_basins_of_a_gear_pair_and_of_its_oscillator_are_the_same():
    # Two attractors at 0.75, of which each motion chooses one.
    pair = GearPair.from_ratios(
        contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash=4.0
    )
    twin = as_oscillator(pair)
    grid = (-3.0, 3.0, 9), (-3.0, 3.0, 9)
    one, other = basins(pair, 0.75, grid, periods=200), basins(twin, 0.75, grid, periods=200)
    assert one.sizes["attractor"] > 1
    np.testing.assert_array_equal(other.basin, one.basin)
    for name in ("period", "attractor_kind"):
        np.testing.assert_array_equal(other[name], one[name])
    for name in ("displacement_max", "displacement_min", "multiplier_real", "state"):
        # Two codes, both to rounding, over orbits found to 1e-12.
        np.testing.assert_allclose(other[name], one[name], rtol=0, atol=1e-9, err_msg=name)

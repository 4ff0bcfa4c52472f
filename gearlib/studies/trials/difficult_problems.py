"""Difficult problems, on which methods miss events, drift, invent motion or stop.

A problem states what is compared, and how far that may be off:

=============  ==================================================================================
quantity       error
=============  ==================================================================================
``state``      difference of the final states, displacement or nu times velocity, over the height
               of the recorded motion (over one static deflection if that is larger)
``contacts``   contact events of the record that are missing, spurious or out of order
``orbit``      difference of the extrema of the settled orbit over its height
``fractions``  difference of the fractions of time in normal mesh, backlash and inverse mesh
``energy``     relative difference of the energy about the rest position, constant stiffness
``deviation``  relative difference of the distance from the orbit without loss of contact
=============  ==================================================================================

Of trains the state has all coordinates, without the free rotation; velocities by theta.

Solvers whose steps are interpreted run `brief_periods` of the long problems; their reference has
as many.
"""

import math
from typing import Any, NamedTuple

from gearlib.analysis.tongues import meissner
from gearlib.engines.pair.stiffness import levels
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.planetary import planetary

QUANTITIES = ("state", "contacts", "orbit", "fractions", "energy", "deviation")


class Problem(NamedTuple):
    """One problem; what is compared and how, see the module."""

    words: str  #: a line of the figure
    model: Any  #: GearPair, OneDegreePair, SixDegreePair or GearTrain
    tuning: float
    state: tuple = (0.0, 0.0)  #: at phase 0; of a train all components
    periods: int = 10
    record_periods: int | None = None  #: the last ones; None: all
    brief_periods: int | None = None  #: for solvers with interpreted steps; None: as many
    quantity: str = "state"
    tolerance: float = 1e-4
    orbit: tuple = ()  #: state at phase 0 of the orbit without loss, for "deviation"

    def recorded(self, periods):
        """Return how many of the periods of a run are recorded."""
        return min(periods, self.record_periods or periods)


#: The pair of the paper with k1, as in config.yaml.
PAPER = GearPair(
    max_stiffness=4.0e8,
    stiffness_ratio=0.5879,
    contact_ratio=1.569,
    reduced_mass=3.123,
    load=3289.5396,
    backlash=40.0e-6,
    material_damping=3953.7,
)
_FREE = PAPER.replace(material_damping=0.0)
#: For tongues: deviations are looked at before flanks part, the far one plays no part.
_ENDLESS = _FREE.replace(backlash=math.inf)
_SIX = {
    "base_radii": (0.1, 0.1),
    "inertias": (0.097852, 0.097852),
    "masses": (17.27, 17.27),
    "bearing_damping": (525.7,) * 4,
    "eccentricities": (8e-6, 8e-6),
    "friction": (0.05, 0.05),
}


def _ratios(contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash=4.0):
    return GearPair.from_ratios(
        contact_ratio=contact_ratio,
        stiffness_ratio=stiffness_ratio,
        damping=damping,
        backlash=backlash,
    )


def _grazing(depth):
    """Return the problem whose motion turns `depth` below the normal flank line."""
    tuning, phase = 0.9, 0.9
    # Backwards from the turning point; a depth in the backlash differs from one in contact by
    # depth times itself.
    high = levels(_FREE.contact_ratio, _FREE.stiffness_ratio)[0]
    start = meissner.state_after((-depth, 0.0), high, 0.0, tuning, -phase)
    side = "past" if depth > 0.0 else "short of"
    size = f"{abs(depth):.0e}".replace("e-0", "e-")
    words = f"grazing, {size} {side} the flank line"
    return Problem(words, _FREE, tuning, start, periods=1, quantity="contacts", tolerance=0.0)


def _resonance(words, tuning, periods, tilt=1e-6):
    """Return the problem that starts next to the orbit without loss of contact."""
    x, v = meissner.orbit(_ENDLESS, tuning)
    return Problem(
        words,
        _ENDLESS,
        tuning,
        (x + tilt, v),
        periods=periods,
        record_periods=1,
        quantity="deviation",
        tolerance=1e-2,
        orbit=(x, v),
    )


def _tongue(name, centre, outside, periods):
    """Return the problems inside a tongue of parametric resonance and just beyond its edge."""
    equation, between = meissner.equation_of(_ENDLESS), sorted((centre, outside))
    (order,) = meissner.orders(equation, centre, centre)
    tongue = meissner.tongue(equation, order)
    (edge,) = (nu for nu in (tongue.start, tongue.stop) if between[0] < nu < between[1])
    beyond = edge + math.copysign(1e-4, outside - centre)
    return {
        f"tongue_{name}": _resonance(f"inside the tongue at $\\nu$ = {centre:g}", centre, periods),
        f"edge_{name}": _resonance(f"beyond its edge, $\\nu$ = {beyond:.4f}", beyond, periods),
    }


def _contact_ratios():
    values = {
        "ratio_1": (1.0, "contact ratio 1"),
        "ratio_2": (2.0, "contact ratio 2"),
        "ratio_above_1": (1.0 + 1e-9, "contact ratio 1 + 1e-9"),
        "ratio_below_2": (2.0 - 1e-9, "contact ratio 2 $-$ 1e-9"),
    }
    return {
        name: Problem(words, _ratios(contact_ratio=value), 0.9, (0.0, -1.0), periods=5)
        for name, (value, words) in values.items()
    }


def _nonlinear():
    cubic = OneDegreePair(pair=_ratios(), cubic_damping=100.0)
    return {
        "cubic_damping": Problem("strong cubic damping", cubic, 0.9, (1.0, -3.0), periods=5),
        "terms_2": Problem(
            "2 Fourier terms", OneDegreePair(pair=PAPER, profile=Fourier(2)), 0.9, periods=10
        ),
        "terms_200": Problem(
            "200 Fourier terms",
            OneDegreePair(pair=PAPER, profile=Fourier(200)),
            0.9,
            periods=2,
        ),
    }


def _settling():
    """Return the problems whose end is asked for: orbits, fractions, energy."""
    fold = {"periods": 96, "record_periods": 24, "quantity": "orbit", "tolerance": 1e-2}
    chaos = _ratios(1.5, 0.3, 0.05, 4.0)
    return {
        "fold_below": Problem("just below the jump, $\\nu$ = 0.81568", PAPER, 0.81568, **fold),
        "fold_above": Problem("just above the jump, $\\nu$ = 0.81571", PAPER, 0.81571, **fold),
        "chaos": Problem(
            "chaos",
            chaos,
            0.52,
            periods=4000,
            record_periods=3900,
            brief_periods=60,
            quantity="fractions",
            # What fractions over the brief periods scatter by.
            tolerance=0.05,
        ),
        "conservative": Problem(
            "$10^5$ periods without loss",
            _ratios(stiffness_ratio=1.0, damping=0.0),
            1.3,
            (1.5, 0.0),
            periods=100_000,
            record_periods=1,
            brief_periods=100,
            quantity="energy",
            tolerance=1e-3,
        ),
        **_tongue("2", 2.0, 2.4, 36),
        **_tongue("066", 0.6614, 0.69, 64),
    }


def planets(push=3.0, ahead=0.0, **changes) -> tuple[Any, float, tuple]:
    """Return (train, tuning, start state) of three planets in phase, whose sun is pushed.

    push, ahead: displacements of the sun, and of the first planet alone, from static equilibrium
    along their base circles, static deflections; **changes: of `gearlib.planetary`.
    """
    # Lin and Parker's train at its second rotational mode, 1475 Hz, 30 % jump of the stiffness.
    train = planetary(stiffness_ratio=(0.7458, 0.7321), **changes)
    state = train.start_state("static")
    coordinates = train.structure.coordinates
    state[coordinates.index(("sun", "u"))] += push
    state[coordinates.index(("planet 1", "u"))] += ahead
    tuning = 2.0 * math.pi * 1475.0 / train.reference_angular_frequency
    return train, tuning, tuple(state.tolist())


def _trains():
    """Return the problems of trains; their references are exact runs, against two other codes."""
    return {
        "planets_at_once": Problem("three meshes part at once", *planets()),
        "planets_apart": Problem("three meshes part 1e-12 apart", *planets(ahead=5e-12)),
        "planets_alike": Problem("all six meshes of a train part", *planets(6.0, ring_phase=0.0)),
    }


def problems():
    """Return all problems, as name -> `Problem`."""
    short = {"periods": 1, "quantity": "contacts", "tolerance": 0.0}
    six = SixDegreePair(pair=PAPER, bearing_stiffness=(1e12,) * 4, **_SIX)
    far = _ratios(damping=0.0, backlash=2e4)
    # From 1e4 above the far flank to 0.1 below it: 140 rad of free flight, of which every method
    # of order 2 and more knows the parabola, so that its steps grow without an error to stop
    # them, and then 0.9 rad beyond the flank line.
    drop = -math.sqrt(2.0 * (1e4 + 0.1))
    return {
        "graze_short_6": _grazing(-1e-6),
        "graze_past_6": _grazing(1e-6),
        "graze_short_10": _grazing(-1e-10),
        "graze_past_10": _grazing(1e-10),
        "tiny_bounce": Problem("a bounce of 2e-8 rad", _FREE, 1.0, (0.0, -1e-8), **short),
        "double_crossing": Problem(
            "in and out within a long step", far, 1.0, (-1e4, drop), periods=40
        ),
        "rest_near": Problem("at rest on the near flank line", PAPER, 0.82, periods=10),
        "rest_far": Problem(
            "at rest on the far flank line", PAPER, 0.82, (-PAPER.backlash_ratio, 0.0)
        ),
        "no_backlash": Problem("no backlash", _ratios(backlash=0.0), 0.9, (0.0, -3.0)),
        "nano_backlash": Problem("backlash 1e-9", _ratios(backlash=1e-9), 0.9, (0.0, -3.0)),
        "endless_backlash": Problem(
            "infinite backlash", _ratios(backlash=math.inf), 0.9, (0.0, -3.0)
        ),
        "critical": Problem(
            "critically damped contact", _ratios(1.0, damping=1.0), 0.9, (0.0, -3.0), periods=1
        ),
        "overdamped": Problem(
            "overdamped contact, $\\beta$ = 20", _ratios(damping=20.0), 0.9, (0.0, -3.0), periods=5
        ),
        "soft": Problem("stiffness ratio 1e-6", _ratios(stiffness_ratio=1e-6), 0.9, periods=5),
        **_contact_ratios(),
        "slow": Problem(
            "200 natural periods per mesh period", _ratios(damping=0.002), 0.005, periods=1
        ),
        "fast": Problem("20 mesh periods per natural period", PAPER, 20.0, (2.0, 0.0), periods=60),
        **_nonlinear(),
        "stiff_bearings": Problem("six degrees, bearings of 1e12 N/m", six, 0.9, periods=2),
        **_settling(),
        **_trains(),
    }

"""Define difficult problems, on which methods miss events, drift, become unstable or stop.

Each problem states the quantity that is compared with the reference, and a tolerance of its error:

=============  ===============================================================================
quantity       error
=============  ===============================================================================
``state``      difference of the final states (displacement, or tuning times velocity) relative to
               the orbit height or the static deflection, whichever is larger
``contacts``   number of contact events that are missing, spurious or out of order
``orbit``      difference of the extrema of the settled orbit, relative to its height
``fractions``  difference of the fractions of time in drive-side contact, without contact and
               in coast-side contact
``energy``     relative difference of the energy about equilibrium at constant stiffness
``deviation``  relative difference of the distance from the orbit without loss of contact
=============  ===============================================================================

The state of a train excludes the rigid-body rotation. Velocities are derivatives with respect to
the mesh phase.
"""

import math
from typing import Any, NamedTuple

from gearlib.analysis.tongues import meissner
from gearlib.engines.pair.stiffness import stiffness_levels
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains.planetary import planetary

QUANTITIES = ("state", "contacts", "orbit", "fractions", "energy", "deviation")


class Problem(NamedTuple):
    """A problem: a motion to compute, and the quantity that is compared with the reference."""

    description: str  #: label in the figure
    model: Any  #: GearPair, OneDegreePair, SixDegreePair or GearTrain
    tuning: float
    state: tuple = (0.0, 0.0)  #: initial state; all components of a train
    periods: int = 10
    record_periods: int | None = None  #: number of last periods that are recorded; None: all
    short_periods: int | None = None  #: periods for solvers with slow interpreted steps
    quantity: str = "state"
    tolerance: float = 1e-4
    orbit: tuple = ()  #: state at phase 0 of the orbit without contact loss, for "deviation"


#: The gear pair of the paper with material damping, as in config.yaml.
PAPER = GearPair(
    max_stiffness=4.0e8,
    stiffness_ratio=0.5879,
    contact_ratio=1.569,
    reduced_mass=3.123,
    load=3289.5396,
    backlash=40.0e-6,
    material_damping=3953.7,
)
_UNDAMPED = PAPER.replace(material_damping=0.0)
#: Pair for instability tongues. The perturbed motion keeps contact, so the backlash has no effect.
_UNDAMPED_WITHOUT_COAST_SIDE = _UNDAMPED.replace(backlash=math.inf)
#: Distance in tuning from the edge of a tongue; displacement of the initial state from the orbit.
_DISTANCE_FROM_TONGUE, _PERTURBATION = 1e-4, 1e-6
_RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "damping": 0.0617}
_COMPARED_CONTACTS = {"periods": 1, "quantity": "contacts", "tolerance": 0.0}


def _build_pair(**changes: float) -> GearPair:
    """Build the paper's gear pair from rounded ratios; `changes` override these ratios."""
    return GearPair.from_ratios(**(_RATIOS | {"backlash_ratio": 4.0} | changes))


def _grazing_problem(side: str, exponent: int) -> Problem:
    """Return a problem whose motion reverses close to the displacement 0 (the flank line).

    Contact is lost at displacements below 0. If `side` is "past", the motion reverses at
    -10^exponent static deflections; if it is "short of", at +10^exponent.
    """
    tuning = 0.9  # mesh frequency over natural frequency
    reversal_phase = 0.9  # rad, within the segment of high stiffness
    sign = {"past": -1.0, "short of": 1.0}[side]
    reversal_state = sign * 10.0**exponent, 0.0
    # The initial state is integrated backwards from the reversal, with the equation in contact.
    high_stiffness = stiffness_levels(_UNDAMPED.contact_ratio, _UNDAMPED.stiffness_ratio)[0]
    start = meissner.propagate_state(
        reversal_state, high_stiffness, damping=0.0, tuning=tuning, phase=-reversal_phase
    )
    description = f"grazing, 1e{exponent} {side} the flank line"
    return Problem(description, _UNDAMPED, tuning, start, **_COMPARED_CONTACTS)


def _tongue_problems(name: str, centre: float, periods: int) -> dict[str, Problem]:
    """Return two problems at tunings inside an instability tongue and just beyond its edge.

    A tongue is an interval of tunings (mesh frequency over natural frequency) in which the motion
    without contact loss is unstable. `centre` is a tuning inside the tongue, and `periods` the
    number of mesh periods. The problems are called "tongue_<name>" and "edge_<name>".
    """
    model = _UNDAMPED_WITHOUT_COAST_SIDE
    problems = {}
    equation = meissner.equation_of_pair(model)
    (order,) = meissner.orders_in_range(equation, centre, centre)
    beyond = meissner.find_tongue(equation, order).stop + _DISTANCE_FROM_TONGUE
    for key, tuning, description in (
        (f"tongue_{name}", centre, f"inside the tongue at $\\nu$ = {centre:g}"),
        (f"edge_{name}", beyond, f"beyond its edge, $\\nu$ = {beyond:.4f}"),
    ):
        displacement, velocity = meissner.orbit_state(model, tuning)
        # The motion starts near the orbit, and the growth of its deviation is compared.
        start = displacement + _PERTURBATION, velocity
        settings = {"periods": periods, "record_periods": 1, "quantity": "deviation"}
        settings |= {"tolerance": 1e-2, "orbit": (displacement, velocity)}
        problems[key] = Problem(description, model, tuning, start, **settings)
    return problems


def _planetary_problem(
    description: str, sun_displacement=3.0, planet_displacement=0.0, **changes: Any
) -> Problem:
    """Return a problem of a train with three planets that starts near static equilibrium.

    Sun and first planet are displaced along their base circles by the given number of static
    deflections. `changes` are arguments of `planetary`; `description` is the label in the figure.
    """
    # The train of Lin and Parker is excited at its second rotational mode (1475 Hz). Coordinates
    # "u" are displacements along base circles.
    train = planetary(stiffness_ratio=(0.7458, 0.7321), **changes)
    state = train.start_state("static")
    coordinates = train.structure.coordinates
    state[coordinates.index(("sun", "u"))] += sun_displacement
    state[coordinates.index(("planet 1", "u"))] += planet_displacement
    tuning = 2.0 * math.pi * 1475.0 / train.reference_angular_frequency
    return Problem(description, train, tuning, tuple(state.tolist()))


def _state_problems() -> dict[str, Problem]:
    """Return the problems that compare final states, as name -> `Problem`.

    By default the motion starts from rest where drive-side contact begins (the near flank line) and
    lasts 10 mesh periods.
    """
    six_degrees = SixDegreePair(
        pair=PAPER,
        base_radii=(0.1, 0.1),
        inertias=(0.097852, 0.097852),
        masses=(17.27, 17.27),
        bearing_stiffness=(1e12,) * 4,
        bearing_damping=(525.7,) * 4,
        eccentricities=(8e-6, 8e-6),
        friction=(0.05, 0.05),
    )
    cubic = OneDegreePair(pair=_build_pair(), cubic_damping=100.0)
    few_terms, many_terms = (OneDegreePair(pair=PAPER, profile=Fourier(n)) for n in (2, 200))
    # Problem "double_crossing": the motion starts 1e4 above the coast-side flank line and reaches
    # 0.1 below it. The free flight of 140 rad is a parabola, which all methods of order 2 or more
    # compute exactly, so their steps grow without limit. The contact after it lasts only 0.9 rad.
    wide_backlash = _build_pair(damping=0.0, backlash_ratio=2e4)
    fall = (-1e4, -math.sqrt(2.0 * (1e4 + 0.1)))
    rest, coast_line = (0.0, 0.0), (-PAPER.backlash_ratio, 0.0)
    down, fast_down = (0.0, -1.0), (0.0, -3.0)
    slow_pair = _build_pair(damping=0.002)
    ratio_above_1, ratio_below_2 = (_build_pair(contact_ratio=r) for r in (1.0 + 1e-9, 2.0 - 1e-9))
    critically_damped = _build_pair(contact_ratio=1.0, damping=1.0)
    overdamped, no_backlash = _build_pair(damping=20.0), _build_pair(backlash_ratio=0.0)
    endless_backlash = _build_pair(backlash_ratio=math.inf)
    # Description, model, tuning, and optionally initial state and number of mesh periods.
    rows = {
        "double_crossing": ("in and out within a long step", wide_backlash, 1.0, fall, 40),
        "rest_near": ("at rest on the near flank line", PAPER, 0.82),
        "rest_far": ("at rest on the coast-side flank line", PAPER, 0.82, coast_line),
        "no_backlash": ("no backlash", no_backlash, 0.9, fast_down),
        "nano_backlash": ("backlash 1e-9", _build_pair(backlash_ratio=1e-9), 0.9, fast_down),
        "endless_backlash": ("infinite backlash", endless_backlash, 0.9, fast_down),
        "critical": ("critically damped contact", critically_damped, 0.9, fast_down, 1),
        "overdamped": ("overdamped contact, $\\beta$ = 20", overdamped, 0.9, fast_down, 5),
        "soft": ("stiffness ratio 1e-6", _build_pair(stiffness_ratio=1e-6), 0.9, rest, 5),
        "ratio_1": ("contact ratio 1", _build_pair(contact_ratio=1.0), 0.9, down, 5),
        "ratio_2": ("contact ratio 2", _build_pair(contact_ratio=2.0), 0.9, down, 5),
        "ratio_above_1": ("contact ratio 1 + 1e-9", ratio_above_1, 0.9, down, 5),
        "ratio_below_2": ("contact ratio 2 $-$ 1e-9", ratio_below_2, 0.9, down, 5),
        "slow": ("200 natural periods per mesh period", slow_pair, 0.005, rest, 1),
        "fast": ("20 mesh periods per natural period", PAPER, 20.0, (2.0, 0.0), 60),
        "cubic_damping": ("strong cubic damping", cubic, 0.9, (1.0, -3.0), 5),
        "terms_2": ("2 Fourier terms", few_terms, 0.9),
        "terms_200": ("200 Fourier terms", many_terms, 0.9, rest, 2),
        "stiff_bearings": ("six degrees, bearings of 1e12 N/m", six_degrees, 0.9, rest, 2),
    }
    return {name: Problem(*row) for name, row in rows.items()}


def build_problems() -> dict[str, Problem]:
    """Return all difficult problems as name -> `Problem`.

    The motion of the paper's pair jumps at the tuning (mesh frequency over natural frequency)
    0.8157. The tunings 2 and 0.6614 are inside instability tongues; the motion at 0.52 is chaotic.
    """
    bounce = Problem("a bounce of 2e-8 rad", _UNDAMPED, 1.0, (0.0, -1e-8), **_COMPARED_CONTACTS)
    fold = {"periods": 96, "record_periods": 24, "quantity": "orbit", "tolerance": 1e-2}
    chaos = Problem(
        "chaos",
        _build_pair(contact_ratio=1.5, stiffness_ratio=0.3, damping=0.05),
        tuning=0.52,
        periods=4000,
        record_periods=3900,
        short_periods=60,
        quantity="fractions",
        # Fractions of time vary by this amount between records of this length.
        tolerance=0.05,
    )
    conservative = Problem(
        "$10^5$ periods without loss",
        _build_pair(stiffness_ratio=1.0, damping=0.0),
        tuning=1.3,
        state=(1.5, 0.0),
        periods=100_000,
        record_periods=1,
        short_periods=100,
        quantity="energy",
        tolerance=1e-3,
    )
    return {
        "graze_short_6": _grazing_problem("short of", exponent=-6),
        "graze_past_6": _grazing_problem("past", exponent=-6),
        "graze_short_10": _grazing_problem("short of", exponent=-10),
        "graze_past_10": _grazing_problem("past", exponent=-10),
        "tiny_bounce": bounce,
        **_state_problems(),
        "fold_below": Problem("just below the jump, $\\nu$ = 0.81568", PAPER, 0.81568, **fold),
        "fold_above": Problem("just above the jump, $\\nu$ = 0.81571", PAPER, 0.81571, **fold),
        "chaos": chaos,
        "conservative": conservative,
        **_tongue_problems("2", centre=2.0, periods=36),
        **_tongue_problems("066", centre=0.6614, periods=64),
        # Meshes of three planets lose contact simultaneously or 1e-12 rad apart. The references are
        # exact runs, which were confirmed with two other programs.
        "planets_at_once": _planetary_problem("three meshes part at once"),
        "planets_apart": _planetary_problem(
            "three meshes part 1e-12 apart", planet_displacement=5e-12
        ),
        "planets_alike": _planetary_problem(
            "all six meshes of a train part", sun_displacement=6.0, ring_phase=0.0
        ),
    }

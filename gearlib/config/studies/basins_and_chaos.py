"""Studies of the global picture: basins, bifurcation diagram, Poincare sections."""

from gearlib.config.global_dynamics import Basins, Bifurcation, Poincare
from gearlib.config.studies.study import (
    EXPLANATIONS,
    LONG,
    Drawing,
    Job,
    Study,
    grid_of,
    without,
)


def _global_cases(c, section):
    """Return the cases of basins or Poincare sections, with the parameters of their gear pairs."""
    return [
        case.model_dump(exclude={"damping", "change"}) | {"pair": c.global_parameters(case)}
        for case in section.cases
    ]


BASINS = Study(
    "basins",
    Basins,
    EXPLANATIONS,
    Job(
        "basins",
        "global_picture:basin_cases",
        lambda c: {
            "cases": _global_cases(c, c.basins),
            "settings": without(c.basins, "cases"),
        },
        priority=LONG,
    ),
    Drawing(
        "basins_figure.draw",
        {"data": "basins.nc"},
        "basins",
        "Basins of attraction",
        """Basins of attraction: every initial state in the colour of the attractor that it
        reaches within {c.basins.periods} mesh periods, on the stroboscopic section τ = 0; marks
        with a white rim are the attractors themselves, n of them for period n. Black: chaotic,
        grey: unbounded, white: undecided. Percentages: share of the plane, with the standard
        error of as many random states.""",
    ),
)

BIFURCATION = Study(
    "bifurcation",
    Bifurcation,
    EXPLANATIONS,
    Job(
        "bifurcation",
        "global_picture:bifurcation",
        lambda c: {
            "pair": c.damped_parameters(c.bifurcation.damping),
            "tunings": grid_of(c.bifurcation),
            "coarse": grid_of(c.bifurcation, "share_step"),
            "settings": without(c.bifurcation, "damping"),
        },
        files=("bifurcation.nc", "basin_stability.nc"),
        priority=LONG,
    ),
    Job(
        "bifurcation_branches",
        "resonance_branches:of_damping",
        lambda c: {
            "damping": "of the bifurcation diagram",
            "pair": c.damped_parameters(c.bifurcation.damping),
            "settings": without(c.branches, "loci")
            | c.bifurcation.model_dump(include={"start", "stop"}),
        },
    ),
    Drawing(
        "bifurcation_figure.draw",
        {
            "diagram": "bifurcation.nc",
            "shares": "basin_stability.nc",
            "branches": "bifurcation_branches.nc",
        },
        "bifurcation",
        "Bifurcation diagram, exponents, shares of the basins",
        """Damping {c.bifurcation.damping.material_damping} N s/m in contact and
        {c.bifurcation.damping.backlash_damping} N s/m in the backlash. Above: displacement at
        the start of each mesh period for rising tuning, falling tuning, and from random initial
        states. Black: continued periodic orbits, dashed where unstable. Middle: the largest
        Lyapunov exponent, of up and down with three standard errors, a line where motions
        settle; positive where the motion is chaotic. Below: the share of the initial states
        that lead to each orbit.""",
    ),
)

POINCARE = Study(
    "poincare",
    Poincare,
    EXPLANATIONS,
    Job(
        "poincare",
        "global_picture:sections",
        lambda c: {
            "cases": _global_cases(c, c.poincare),
            "settings": without(c.poincare, "cases"),
        },
    ),
    Drawing(
        "poincare_figure.draw",
        {"data": "poincare.nc"},
        "poincare",
        "Poincaré sections",
        """Displacement and velocity once in every mesh period, at the phase in the title, of
        {c.poincare.orbits} motions in each panel. Chaotic motions (orange) fill areas without
        damping and settle on a layered set with damping; regular ones (other colours) run on
        closed curves and chains of islands, or settle on points. Grey: undecided, because
        deviations have grown by more than in regular motion, but not by as much as in chaos.""",
    ),
)

"""Published oscillators with a dead zone: equations and parameters.

===============  ===================================================================================
problem          source, and what was checked of it
===============  ===================================================================================
gear_rattle      Mason, Piiroinen, Wilson, Homer: Basins of attraction in nonsmooth models of gear
                 rattle, International Journal of Bifurcation and Chaos 19 (2009) 203-224,
                 doi:10.1142/S021812740902283X: title, journal and DOI; equation and parameters as
                 A. Wagemakers' collection of basins (github.com/awage/BasinsCollection) has them.
gear_pair        Kahraman, Singh: Interactions between time-varying mesh stiffness and clearance
                 non-linearities in a geared system, Journal of Sound and Vibration 146 (1991)
                 135-156: the form of the equation is theirs; the origin of this set of parameters
                 could not be opened.
soft_impact      de Souza, Wiercigroch, Caldas, Balthazar: Suppressing grazing chaos in impacting
                 system by structural nonlinearity, Chaos, Solitons & Fractals 38 (2008) 864-869,
                 doi:10.1016/j.chaos.2007.01.022: DOI, equation and parameters as in the same
                 collection, for chaos beside a motion without impact.
===============  ===================================================================================

No article could be opened, so no number of theirs is compared, but the motion by the program
of `tests.independent` and the closed form of the motion without impact.
"""

import math

from gearlib import DeadZoneOscillator, Harmonics, Series


def gear_rattle(eccentricity=0.1, backlash=0.6, drag=0.6, stiffness=100.0):
    """Return the model of rattling gears and the frequency of its forcing, whose period is 1.

    theta'' + d theta' + 2 k B(theta) = 4 pi d - 4 pi^2 e cos 2 pi t - 2 pi e d sin 2 pi t, with the
    backlash function B, 0 in |theta| < `backlash`.
    """
    forcing = Harmonics(
        (-4.0 * math.pi**2 * eccentricity,), (-2.0 * math.pi * eccentricity * drag,)
    )
    model = DeadZoneOscillator(
        upper_edge=backlash,
        lower_edge=-backlash,
        upper_stiffness=2.0 * stiffness,
        damping=drag,
        load=4.0 * math.pi * drag,
        forcing=forcing,
    )
    return model, 2.0 * math.pi


def gear_pair():
    """Return the model of a gear pair and its mesh frequency W; no source of its values is known.

    x'' + 2 zeta x' + k(t) B(x) = F_m + sum F_r (r W)^2 cos r W t, with harmonics r = 1 to 3.
    """
    model = DeadZoneOscillator(
        upper_edge=1.0,
        lower_edge=-1.0,
        upper_stiffness=Series(1.0, Harmonics((-0.2, -0.1, -0.05))),
        damping=2.0 * 0.05,
        load=0.1,
        # The support moves by minus the error of the transmission.
        deviation=Harmonics((-0.01, -0.004, -0.002)),
    )
    return model, 0.5


def soft_impact(gap=0.63):
    """Return the model of a soft stop at y = `gap` and the frequency omega of its published chaos.

    y'' + 0.04 y' + y + 20 H(y - gap) (y - gap) = 0.5 cos omega t, with the unit step H.
    """
    model = DeadZoneOscillator(
        upper_edge=gap,
        upper_stiffness=20.0,
        damping=2.0 * 0.02,
        ground_stiffness=1.0,
        forcing=Harmonics((0.5,)),
    )
    return model, 0.417893


PROBLEMS = {make.__name__: make() for make in (gear_rattle, gear_pair, soft_impact)}

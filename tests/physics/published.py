"""Published oscillators with a dead zone: equations and parameters.

Gear rattle and soft stop are taken from A. Wagemakers' collection of basins of attraction
(github.com/awage/BasinsCollection). The articles themselves were not available, so that no result
of theirs is compared.
"""

import math

from gearlib import DeadZoneOscillator, Harmonics, Series


def gear_rattle(eccentricity=0.1, backlash=0.6, drag=0.6, stiffness=100.0):
    """Return the model of rattling gears and its forcing frequency 2 pi, rad/s.

    Mason, Piiroinen, Wilson, Homer: Basins of attraction in nonsmooth models of gear rattle,
    International Journal of Bifurcation and Chaos 19 (2009) 203-224, doi:10.1142/S021812740902283X:
    theta'' + d theta' + 2 k B(theta) = 4 pi d - 4 pi^2 e cos 2 pi t - 2 pi e d sin 2 pi t, with the
    drag d, stiffness k, eccentricity e and the backlash function B, which is 0 in
    |theta| < `backlash`.
    """
    cosine = -4.0 * math.pi**2 * eccentricity
    sine = -2.0 * math.pi * eccentricity * drag
    forcing = Harmonics((cosine,), (sine,))
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
    """Return the model of a gear pair and its mesh frequency W.

    The equation is x'' + 2 zeta x' + k(t) B(x) = F_m + sum F_r (r W)^2 cos r W t with the harmonics
    r = 1 to 3: Kahraman, Singh: Interactions between time-varying mesh stiffness and clearance
    non-linearities in a geared system, Journal of Sound and Vibration 146 (1991) 135-156. The
    values of the parameters are not from this article.
    """
    model = DeadZoneOscillator(
        upper_edge=1.0,
        lower_edge=-1.0,
        upper_stiffness=Series(1.0, Harmonics((-0.2, -0.1, -0.05))),
        damping=2.0 * 0.05,
        load=0.1,
        # The support moves by minus the transmission error.
        deviation=Harmonics((-0.01, -0.004, -0.002)),
    )
    return model, 0.5


def soft_impact(gap=0.63):
    """Return the model of a soft stop at y = `gap` and the forcing frequency omega of its chaos.

    de Souza, Wiercigroch, Caldas, Balthazar: Suppressing grazing chaos in impacting system by
    structural nonlinearity, Chaos, Solitons & Fractals 38 (2008) 864-869,
    doi:10.1016/j.chaos.2007.01.022:
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

"""The statements: id, text, place in the paper, figure of the workflow, and the rule."""

from gearlib.studies.claims import rules

CHECKS = (
    (
        "P1",
        "nu = 0.815: nu_max 0.7391, nu_min 0.9639; nu = 0.8151: 0.7392, 0.9640",
        "text to Fig. 6",
        "Fig. 3",
        rules.printed_tunings,
    ),
    (
        "P2",
        "k1 = 3.95, 4, 0.04 N s/mm: beta 0.062, 0.0624, 0.000624",
        "text, Fig. 2",
        "Fig. 3",
        rules.printed_damping_ratios,
    ),
    (
        "P3",
        "the size of k1 shifts the phase of y(t) against C(t)",
        "Fig. 2",
        "Fig. 2",
        rules.phase_shift,
    ),
    (
        "P4",
        "conservative: normal mesh for 0.6 <= nu < 0.8 except a small region near 0.66",
        "Fig. 3",
        "Fig. 3",
        rules.undamped_contact_below_resonance,
    ),
    (
        "P5",
        "conservative: contact bounces begin at nu = 0.8; above, bounces and inverse mesh, chaotic",
        "Fig. 3",
        "Fig. 3",
        rules.undamped_chaos_in_resonance,
    ),
    (
        "P6",
        "k1 > 0: normal mesh on 0.6 ... 0.8, bounces on 0.8 ... 1.12 without inverse mesh, normal "
        "mesh again above",
        "Fig. 3",
        "Fig. 3",
        rules.damped_contact_loss_range,
    ),
    (
        "P7",
        "k1 = 0, k1m > 0 is the only damped variant not in purely normal mesh above 1.12",
        "Fig. 3",
        "Fig. 3",
        rules.contact_loss_above_resonance,
    ),
    (
        "P8",
        "contact ratio 1.1: mesh mostly at C_min; 1.9: mostly at C_max",
        "Fig. 4",
        "Fig. 4",
        rules.contact_ratios,
    ),
    (
        "P9",
        "conservative phase planes: all unsteady, bounces at 0.66, 0.80, 0.81, 0.82, inverse mesh "
        "at 0.81, 0.82 only",
        "Fig. 5",
        "Fig. 5",
        rules.undamped_phase_planes,
    ),
    (
        "P10",
        "k1 = 0, k1m > 0: unsteady at 0.60, 0.66, 0.78; every other damped cell steady",
        "Fig. 5",
        "Fig. 5",
        rules.damped_phase_planes,
    ),
    (
        "P11",
        "nu = 0.815 and 0.8151 give drastically different orbits: small and large bounces",
        "Fig. 6",
        "Fig. 6",
        rules.two_tunings,
    ),
    (
        "P12",
        "time in mesh at C_min at nu = 0.82: t(k1,k1m) > t(k1,0) > t(0,k1m)",
        "Fig. 7",
        "Fig. 7",
        rules.time_at_min_stiffness,
    ),
    (
        "P13",
        "conservative, nu = 0.66, six degrees of freedom: unsteady, contact bounces",
        "Fig. 8",
        "Fig. 8",
        rules.six_degrees,
    ),
)

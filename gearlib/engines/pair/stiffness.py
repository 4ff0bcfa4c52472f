"""Mesh stiffness of a gear pair over one mesh period: Eq. (1) and (2).

With kappa = C_min / C_max, contact ratio epsilon and mesh phase tau (2 pi per mesh period),
the full Fourier series of Eq. (1) is the rectangular wave

    C(tau) = C_max   on |tau| <= pi (epsilon - 1),   C_min elsewhere,

centred on tau = 0, with mean C_s = kappa C_max + (1 - kappa) C_max (epsilon - 1), Eq. (2).
All values in this module are ratios. The stiffness is constant if epsilon is 1 or 2.
"""

import math


def mean_over_max(contact_ratio, stiffness_ratio):
    """Return the mean mesh stiffness divided by its maximum, C_s / C_max, Eq. (2).

    `stiffness_ratio` is C_min / C_max. The contact ratio is the mean number of pairs of teeth in
    contact.
    """
    return stiffness_ratio + (1.0 - stiffness_ratio) * (contact_ratio - 1.0)


def force_note(stiffness_ratio, is_rectangle=True):
    """Return a warning that the mesh force jumps with the stiffness, or "" if that is constant.

    `stiffness_ratio`, kappa, is C_min / C_max. `is_rectangle` is True for a rectangular stiffness
    with two levels, and False for any other stiffness with steps. K_v is the dynamic factor.
    """
    if stiffness_ratio == 1.0:
        return ""
    stiffness = "rectangular stiffness" if is_rectangle else "stiffness with steps"
    factor = "1/kappa =" if is_rectangle else "a factor of up to"
    return (
        f"The mesh force of a {stiffness} jumps by {factor} {1.0 / stiffness_ratio:.4g} "
        "where a pair of teeth enters, at every speed: its largest value is not a K_v. Tip relief "
        "and pitch errors are left out."
    )


def stiffness_levels(contact_ratio, stiffness_ratio):
    """Return both stiffness levels divided by the mean stiffness, (C_max / C_s, C_min / C_s).

    `stiffness_ratio` is C_min / C_max.
    """
    maximum = 1.0 / mean_over_max(contact_ratio, stiffness_ratio)
    return maximum, stiffness_ratio * maximum


def segment_lengths(contact_ratio):
    """Return the lengths, in rad of mesh phase, of half a C_max segment and of a C_min segment.

    One mesh period, 2 pi, consists of half a C_max segment, the C_min segment and the other half.
    """
    return math.pi * (contact_ratio - 1.0), 2.0 * math.pi * (2.0 - contact_ratio)

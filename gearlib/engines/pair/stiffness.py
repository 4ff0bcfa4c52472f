"""Mesh stiffness over one mesh period: Eq. (1) and (2).

With kappa = C_min / C_max, contact ratio epsilon and mesh phase tau (one mesh period
is 2 pi), the full Fourier series of Eq. (1) is the rectangular wave

    C(tau) = C_max   on |tau| <= pi (epsilon - 1),   C_min elsewhere,

centred on tau = 0, with mean C_s = kappa C_max + (1 - kappa) C_max (epsilon - 1), Eq. (2).
Everything here is a ratio; epsilon = 1 and epsilon = 2 are constant stiffness.
"""

import math


def mean_over_max(contact_ratio, stiffness_ratio):
    """Return C_s / C_max, Eq. (2)."""
    return stiffness_ratio + (1.0 - stiffness_ratio) * (contact_ratio - 1.0)


def force_note(stiffness_ratio):
    """Return the sentence that forces of a rectangular stiffness are no dynamic factors."""
    if stiffness_ratio == 1.0:
        return ""
    return (
        f"The mesh force of a rectangular stiffness jumps by 1/kappa = {1.0 / stiffness_ratio:.4g} "
        "where a pair of teeth enters, at every speed: its largest value is not a K_v. Tip relief "
        "and pitch errors are left out."
    )


def levels(contact_ratio, stiffness_ratio):
    """Return (C_max / C_s, C_min / C_s)."""
    high = 1.0 / mean_over_max(contact_ratio, stiffness_ratio)
    return high, stiffness_ratio * high


def segment_lengths(contact_ratio):
    """Return the phase lengths (half of the C_max segment, whole C_min segment) of one period.

    One mesh period from tau = 0 is: half a segment of C_max, one of C_min, the other half of C_max.
    """
    return math.pi * (contact_ratio - 1.0), 2.0 * math.pi * (2.0 - contact_ratio)

"""Whether contact is lost, by the share of time in contact."""

#: Shares of time that are this close to each other differ by the rounding of sums.
ROUNDING = 1e-9


def lost_share(fraction_normal):
    """Return the share of time without drive-side contact, 0 where it is rounding."""
    loss = 1.0 - fraction_normal
    return loss * (loss > ROUNDING)

"""What is said of a motion that has no period yet."""


def not_settled(run):
    """Return in words that the motion of a run of `gearlib.simulate` has not settled."""
    return f"not settled after {int(run.followed)} mesh periods"

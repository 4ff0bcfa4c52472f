"""The involute function and its inverse (ISO 21771)."""

import math


def inv(angle):
    """Return tan(angle) - angle."""
    return math.tan(angle) - angle


def angle_of(value):
    """Return the angle in [0, pi / 2) whose involute is `value` >= 0, by Newton's method."""
    # inv is convex: from the right of the root, Newton's steps fall towards it.
    tangent = value + math.pi / 2.0
    for _ in range(100):
        # In t = tan(angle): t - arctan(t) = value, whose derivative is t^2 / (1 + t^2).
        step = (tangent - math.atan(tangent) - value) * (1.0 + tangent**2) / tangent**2
        tangent -= step
        if tangent <= 0.0:
            return 0.0
        if abs(step) <= 1e-15 * tangent:
            break
    return math.atan(tangent)

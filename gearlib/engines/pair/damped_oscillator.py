"""Contact: closed form of the damped linear oscillator.

Between two stiffness switches the flanks touch as

    u'' + 2 a u' + W^2 u = 0,    a = beta / nu,    W^2 = c / nu^2,

u the displacement from the equilibrium of the present stiffness level. With p = u0' + a u0 and
q = a u0' + W^2 u0 the motion is

    u(t)  = u0  C(t) + p S(t),        C = exp(-a t) cos(w t),      S = exp(-a t) sin(w t) / w
    u'(t) = u0' C(t) - q S(t),        (cosh, sinh when over-damped; 1, t when critical)

with w^2 = |W^2 - a^2|.
"""

import math
from typing import NamedTuple

from gearlib.engines.jit import inlined, kernel

UNDERDAMPED, CRITICAL, OVERDAMPED = 1, 0, -1


class Level(NamedTuple):
    """One stiffness level: its oscillator and where it comes to rest."""

    a: float  #: decay rate
    square: float  #: W^2
    w: float  #: damped frequency, or half the difference of the two rates when over-damped
    kind: int  #: UNDERDAMPED, CRITICAL or OVERDAMPED
    equilibrium: float  #: equilibrium of the deflection, 1 / c
    stiffness: float  #: c = C / C_s


@kernel
def level(stiffness, damping, tuning):
    """Return the `Level` of stiffness c = C / C_s, damping ratio beta and tuning nu."""
    a = damping / tuning
    natural = math.sqrt(stiffness) / tuning
    # The product keeps the digits that W^2 - a^2 would lose next to critical damping.
    difference = (natural - a) * (natural + a)
    kind = UNDERDAMPED if difference > 0.0 else (OVERDAMPED if difference < 0.0 else CRITICAL)
    return Level(a, natural * natural, math.sqrt(abs(difference)), kind, 1.0 / stiffness, stiffness)


@inlined
def propagators(lev, t):
    """Return (C(t), S(t))."""
    if lev.kind == UNDERDAMPED:
        decay = math.exp(-lev.a * t)
        return decay * math.cos(lev.w * t), decay * math.sin(lev.w * t) / lev.w
    if lev.kind == CRITICAL:
        decay = math.exp(-lev.a * t)
        return decay, decay * t
    # exp(-(a - w) t) times bounded factors: never inf * 0, and a - w without cancellation.
    decay = 0.5 * math.exp(-lev.square / (lev.a + lev.w) * t)
    fast = math.expm1(-2.0 * lev.w * t)
    return decay * (2.0 + fast), -decay * fast / lev.w


@inlined
def evolve(lev, u, v, t):
    """Return (u(t), u'(t)) from (u, v) at 0."""
    c, s = propagators(lev, t)
    return u * c + (v + lev.a * u) * s, v * c - (lev.a * v + lev.square * u) * s


@kernel
def turning_time(lev, u, v):
    """Return the first t > 0 with u'(t) = 0, infinity if there is none.

    Turning points of an under-damped motion follow each other at pi / w; an over-damped or
    critical motion has one at most.
    """
    q = lev.a * v + lev.square * u
    if v == 0.0:
        # At rest on a turning point: the next one is half a turn away.
        return math.pi / lev.w if lev.kind == UNDERDAMPED and u != 0.0 else math.inf
    if lev.kind == UNDERDAMPED:
        # The signs go into atan2 so that a turning point close by keeps its relative accuracy.
        return math.atan2(abs(v) * lev.w, math.copysign(1.0, v) * q) / lev.w
    if lev.kind == CRITICAL:
        ratio = v / q
        return ratio if ratio > 0.0 else math.inf
    # artanh(w v / q) with 1 - w v / q in closed form, which heavy damping would round to zero.
    ratio = v / (lev.square * (v / (lev.a + lev.w) + u))
    return math.log1p(2.0 * lev.w * ratio) / (2.0 * lev.w) if ratio > 0.0 else math.inf

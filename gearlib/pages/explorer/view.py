"""From slider values to the arrays that the explorer draws; no browser here."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np
import yaml

from gearlib import config
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.config.laying import laid_over
from gearlib.data.summary import in_words
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import sweep

#: Mesh periods of every run of a characteristic, and the last ones that are evaluated.
_PERIODS, _RECORDED = 70, 10
#: Mesh periods before the phase plane, so that it shows a settled motion.
_SETTLE = 300
_CURVE = ("tuning", "displacement_max", "displacement_min")


@dataclass(frozen=True)
class Setting:
    """What the sliders say; ratios dimensionless, backlash and load in SI."""

    tuning: float
    damping: float  #: beta
    backlash_damping: float  #: beta_m
    stiffness_ratio: float  #: kappa
    contact_ratio: float  #: epsilon
    backlash: float  #: m
    load: float  #: N

    @classmethod
    def of(cls, pair, tuning):
        """Return the setting that stands for a pair at a tuning."""
        return cls(
            tuning,
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.stiffness_ratio,
            pair.contact_ratio,
            pair.backlash,
            pair.load,
        )

    def pair(self, base):
        """Return the gear pair: `base` with what the sliders say."""
        pair = base.replace(
            stiffness_ratio=self.stiffness_ratio,
            contact_ratio=self.contact_ratio,
            backlash=self.backlash,
            load=self.load,
        )
        critical = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
        return pair.replace(
            material_damping=self.damping * critical,
            backlash_damping=self.backlash_damping * critical,
        )


@dataclass(frozen=True)
class View:
    """What is seen at one setting."""

    up: dict  #: tuning, displacement_max, displacement_min of the sweep up
    down: dict
    course: dict  #: phase, displacement, velocity, force over the last two mesh periods
    multipliers: np.ndarray  #: Floquet multipliers, empty if no orbit was found
    period: int  #: mesh periods after which the motion repeats, 0 if it does not
    message: str  #: what the motion is, in words


def look(pair, tuning, grid):
    """Return the `View`: what the explorer draws at one tuning, the characteristic on a grid."""

    def curve(direction):
        swept = sweep(
            pair, grid, periods=_PERIODS, record_periods=_RECORDED, direction=direction, threads=1
        )
        return {name: swept[name].values for name in _CURVE}

    # The kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        up, down = pool.map(curve, ("up", "down"))
    run = simulate(pair, tuning, periods=_SETTLE, record_periods=_RECORDED, samples_per_period=256)
    shown = slice(-512, None)
    course = {
        "phase": run.phase.values[shown] - run.phase.values[-512],
        "displacement": run.displacement.values[shown],
        "velocity": run.velocity.values[shown],
        "force": run.dynamic_force.values[shown],
    }
    period = int(run.period)
    multipliers = np.empty(0)
    if period:
        try:
            orbit = periodic_orbit(pair, tuning, guess=run.final_state.values, period=period)
            multipliers = orbit.multipliers
        except NoOrbit:
            period = 0
    return View(
        up, down, course=course, multipliers=multipliers, period=period, message=in_words(run)
    )


def configuration(mapping, damping, setting):
    """Return the text of a config.yaml that computes what is seen; `gearlib.config.load` takes it.

    What the sliders do not touch of `mapping`, from which the explorer started, is kept; they
    stand for its damping of this name.
    """
    settings = config.load(mapping)
    pair = asdict(setting.pair(GearPair(**settings.pair_parameters(damping))))
    seen = {
        "gear_pair": {key: pair[key] for key in settings.gear_pair.model_dump()},
        "dampings": {damping: {key: pair[key] for key in ("material_damping", "backlash_damping")}},
        "phase_planes": {"tunings": [setting.tuning]},
    }
    whole = laid_over(mapping, seen)
    config.load(whole)
    text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)
    return f"# What gearlib explore showed at tuning {setting.tuning:g}, damping {damping}.\n{text}"


def finite_backlash(pair):
    """Return a backlash for the slider: that of the pair, or four static deflections."""
    return pair.backlash if math.isfinite(pair.backlash) else 4.0 * pair.static_deflection

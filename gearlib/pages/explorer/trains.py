"""From slider values to the arrays that the explorer draws of a gear train; no browser here."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import xarray as xr
import yaml

from gearlib import config
from gearlib.config.laying import laid_over
from gearlib.models.trains.described import described
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import sweep

#: Trains that can be chosen, by the names of their sections.
KINDS = {
    "planetary": "planetary set",
    "split_power_reducer": "reducer",
    "idler": "idler",
    "two_stage": "two stages",
    "own": "train of one's own",
}
#: Mesh periods of every run of a characteristic, and the last ones that are evaluated; the latter
#: hold whole common periods of the default trains.
_PERIODS, _RECORDED = 36, 12
_SETTLE = 180
#: Speeds of the characteristic, as shares of that at which the mesh frequency is the lowest elastic
#: natural frequency.
_LOWEST, _HIGHEST, _POINTS = 0.5, 4.0, 60
#: Where the stiffness of the meshes is constant, nothing would move: the jump to start from.
_JUMP = 0.3


@dataclass(frozen=True)
class Setting:
    """What the sliders say."""

    speed: float  #: of the reference pinion, rpm
    stiffness_jump: float  #: 1 - kappa, of all meshes
    backlash: float  #: of all meshes, m
    load: float  #: on each mesh of the driving gear, of one's own train on the reference mesh, N
    pin_error: float = 0.0  #: tangential, of the first planet or satellite, m


@dataclass(frozen=True)
class View:
    """What is seen at one setting."""

    up: xr.Dataset  #: of a sweep of the speed, over tuning and mesh
    down: xr.Dataset
    speeds: np.ndarray  #: rpm, of both sweeps
    run: xr.Dataset  #: of `gearlib.simulate` at the chosen speed
    message: str  #: what the motion is, in words


def offered(mapping):
    """Return those of `KINDS` that a configuration can show: a train of one's own if it has one."""
    own = config.load(mapping).train.own
    return {key: name for key, name in KINDS.items() if key != "own" or own.meshes}


class Machine:
    """A train of a configuration, and what sliders change of it.

    Parameters
    ----------
    mapping : dict
        A configuration that `gearlib.config.load` accepts.
    damping : str
        One of its dampings, for trains that are made of the gear pair.
    kind : str
        One of `KINDS`.
    """

    def __init__(self, mapping, damping, kind):
        section = dict(mapping.get("train", {}))
        settings = config.load(mapping)
        if settings.train.kind != kind:
            # They are those of the other train.
            for key in ("reference", "reference_frequency"):
                section.pop(key, None)
        self.mapping = {**mapping, "train": {**section, "kind": kind}}
        self.damping, self.kind = damping, kind
        self.values = config.load(self.mapping).train_parameters(damping)
        train = described(**self.values)
        self.meshes = train.mesh_names
        lowest = math.sqrt(train.linear_modes[0][0]) / train.reference_angular_frequency
        self.speeds = _rpm(train) * lowest * np.linspace(_LOWEST, _HIGHEST, _POINTS)
        first = train.reference_mesh
        arguments = self.values["arguments"]
        #: What is made of the gear pair takes its load; all of its keys, where gears are drawn.
        self._pair = None if kind in ("planetary", "own") else settings.gear_pair.model_dump()
        load = abs(train.load) if self._pair is None else self._pair["load"]
        #: Misplaced axes, of the trains that may have them.
        self.pin_errors = []
        if kind in ("planetary", "split_power_reducer"):
            self.pin_errors = arguments.get("pin_errors") or [[0.0, 0.0]] * (len(self.meshes) // 2)
        gap = first.backlash if math.isfinite(first.backlash) else 4.0 * train.static_deflection
        self.start = Setting(
            speed=float(self.speeds[_POINTS // 3]),
            stiffness_jump=1.0 - first.stiffness_ratio if first.stiffness_ratio < 1.0 else _JUMP,
            backlash=gap,
            load=float(f"{load:.6g}"),
            pin_error=self.pin_errors[0][1] if self.pin_errors else 0.0,
        )

    def sections(self, setting):
        """Return the sections of the configuration that the sliders stand for."""
        kappa = 1.0 - setting.stiffness_jump
        arguments = self.values["arguments"]
        own, flanks = {}, {"backlash": setting.backlash, "load": setting.load}
        if self.pin_errors:
            first = [self.pin_errors[0][0], setting.pin_error]
            own = {"pin_errors": [first, *self.pin_errors[1:]]}
        if self.kind == "planetary":
            own |= {**flanks, "stiffness_ratio": [kappa, kappa]}
        elif self.kind == "own":
            share = setting.load / self.start.load
            teeth = {"backlash": setting.backlash, "stiffness_ratio": kappa}
            own = {
                "bodies": [
                    b | {"torque": share * b.get("torque", 0.0)} for b in arguments["bodies"]
                ],
                "meshes": [mesh | teeth for mesh in arguments["meshes"]],
            }
        elif "backlashes" in arguments:
            own["backlashes"] = [[setting.backlash] * 2] * len(self.pin_errors)
        changed = {"train": {self.kind: own}}
        if self._pair is None:
            return changed
        return changed | {"gear_pair": {**self._pair, **flanks, "stiffness_ratio": kappa}}

    def train(self, setting):
        """Return the `GearTrain` that the sliders stand for."""
        whole = laid_over(self.mapping, self.sections(setting))
        return described(**config.load(whole).train_parameters(self.damping))

    def rpm(self, setting):
        """Return the speed of the reference pinion at tuning 1, rpm."""
        return _rpm(self.train(setting))

    def configuration(self, setting):
        """Return the text of a config.yaml that describes what is seen."""
        whole = laid_over(self.mapping, self.sections(setting))
        config.load(whole)
        text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)
        head = f"# What gearlib explore showed at {setting.speed:g} rpm, damping {self.damping}."
        return f"{head}\n{text}"

    def look(self, setting):
        """Return the `View` of a setting."""
        train = self.train(setting)
        rpm = _rpm(train)

        def curve(direction):
            return sweep(
                train,
                self.speeds / rpm,
                periods=_PERIODS,
                record_periods=_RECORDED,
                direction=direction,
                threads=1,
            )

        # The kernels release the interpreter lock.
        with ThreadPoolExecutor(2) as pool:
            up, down = pool.map(curve, ("up", "down"))
        run = simulate(
            train,
            setting.speed / rpm,
            periods=_SETTLE,
            record_periods=_RECORDED,
            samples_per_period=64,
        )
        return View(up, down, self.speeds, run, _in_words(run))


def _rpm(train):
    """Return the speed of the reference pinion at tuning 1, rpm."""
    return float(train.speed_scales(1.0)["speed"])


def _in_words(run):
    if int(run.status):
        return run.status.attrs["message"]
    period = int(run.period)
    motion = f"repeats after {period} mesh periods" if period else "does not repeat soon"
    lost = (run.fraction_backlash + run.fraction_inverse).values > 0.0
    parted = [str(name) for name in run.mesh.values[lost]]
    contact = f"contact is lost in {', '.join(parted)}" if parted else "all meshes stay in contact"
    return f"The motion from rest {motion}; {contact}."

"""From slider values to the arrays that the explorer draws of a gear train; no browser here."""

import math
from typing import ClassVar

import numpy as np

from gearlib import config
from gearlib.config.laying import laid_over
from gearlib.models.pair import GearPair
from gearlib.models.trains.described_train import described
from gearlib.pages.explorer.explored import Explored, Slider, saved, slider_of
from gearlib.pages.explorer.view import TRAIN, look

#: Trains that can be chosen, by the names of their sections.
KINDS = {
    "planetary": "planetary set",
    "split_power_reducer": "reducer",
    "idler": "idler",
    "two_stage": "two stages",
    "own": "train of one's own",
}
#: Speeds of the characteristic, as shares of that at which the mesh frequency is the lowest elastic
#: natural frequency.
_LOWEST, _HIGHEST, _POINTS = 0.5, 4.0, 60
#: Where the stiffness of the meshes is constant, nothing would move: the jump to start from.
_JUMP = 0.3


def offered(mapping):
    """Return those of `KINDS` that a configuration can show: a train of one's own if it has one."""
    own = config.load(mapping).train.own
    return {key: name for key, name in KINDS.items() if key != "own" or own.meshes}


class Machine(Explored):
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

    #: A view takes a second.
    event: ClassVar = "value_throttled"

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
        jump = 1.0 - first.stiffness_ratio if first.stiffness_ratio < 1.0 else _JUMP
        load = float(f"{load:.6g}")
        ends = float(np.ceil(self.speeds[0])), float(np.floor(self.speeds[-1]))
        self.sliders = {
            "speed": Slider(
                "speed of the reference pinion, rpm", float(self.speeds[_POINTS // 3]), (*ends, 1.0)
            ),
            "stiffness_jump": Slider("stiffness jump 1 - κ", jump, (0.0, 0.9, 0.005)),
            "backlash": slider_of(
                GearPair, "backlash", gap, 0.5, high=max(200.0, 3e6 * gap), unit=1e-6
            ),
            # On each mesh of the driving gear; of a train of one's own on the reference mesh.
            "load": Slider(
                "load on each driving mesh, N", load, (0.05 * load, 5.0 * load, 0.01 * load)
            ),
        }
        if self.pin_errors:
            # Tangential.
            self.sliders["pin_error"] = Slider(
                "pin error of the first, µm", self.pin_errors[0][1], (-50.0, 50.0, 0.5), 1e-6
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
        head = f"at {setting.speed:g} rpm, damping {self.damping}."
        return saved(head, laid_over(self.mapping, self.sections(setting)))

    def look(self, setting):
        """Return the view of a setting."""
        train = self.train(setting)
        rpm = _rpm(train)
        return look(train, setting.speed / rpm, self.speeds / rpm, TRAIN)


def _rpm(train):
    """Return the speed of the reference pinion at tuning 1, rpm."""
    return float(train.speed_scales(1.0)["speed"])

"""From slider values to the arrays that the explorer draws of a gear train; no browser here."""

import math
from typing import ClassVar

import numpy as np

from gearlib import config
from gearlib.config.laying import laid_over
from gearlib.config.train_section import OF_PAIRS
from gearlib.models.pair import GearPair
from gearlib.models.trains.described_train import described
from gearlib.pages.explorer.explored import Explored, Slider, saved, slider_of
from gearlib.pages.explorer.view import TRAIN, look

#: Trains that can be chosen, by the names of their sections.
KINDS = {
    "planetary": "planetary set",
    "planetary_set": "drawn planetary set",
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
    """Return those of `KINDS` that a configuration can show: what it has to describe if it does."""
    train = config.load(mapping).train
    described_there = {"own": train.own.meshes, "planetary_set": train.planetary_set}
    return {key: name for key, name in KINDS.items() if described_there.get(key, True)}


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
        teeth = ", ".join(f"{b.name} z {b.teeth}" for b in train.bodies if b.teeth)
        self.heading = f"{KINDS[kind].capitalize()}: {teeth}"
        lowest = math.sqrt(train.linear_modes[0][0]) / train.reference_angular_frequency
        self.speeds = _rpm(train) * lowest * np.linspace(_LOWEST, _HIGHEST, _POINTS)
        first = train.reference_mesh
        arguments = self.values["arguments"]
        #: What is made of the gear pair takes its load; all of its keys, where gears are drawn.
        self._pair = settings.gear_pair.model_dump() if kind in OF_PAIRS else None
        load = abs(train.load) if self._pair is None else self._pair["load"]
        #: Misplaced axes, of the trains that may have them.
        self.pin_errors = []
        if kind in ("planetary", "planetary_set", "split_power_reducer"):
            self.pin_errors = arguments.get("pin_errors") or [[0.0, 0.0]] * (len(self.meshes) // 2)
        gap = first.backlash if math.isfinite(first.backlash) else 4.0 * train.static_deflection
        jump = 1.0 - first.stiffness_ratio if first.stiffness_ratio < 1.0 else _JUMP
        #: Sliders that do not start where the configuration is.
        self._off = {
            name
            for name, value, start in (
                ("stiffness_jump", 1.0 - first.stiffness_ratio, jump),
                ("backlash", first.backlash, gap),
            )
            if value != start
        }
        load = float(f"{load:.6g}")
        ends = float(np.ceil(self.speeds[0])), float(np.floor(self.speeds[-1]))
        self.sliders = {
            "speed": Slider(
                "speed of the reference pinion, rpm",
                float(np.clip(np.round(self.speeds[_POINTS // 3]), *ends)),
                (*ends, 1.0),
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
        if kind == "planetary_set":
            # Stiffness follows from the drawing.
            del self.sliders["stiffness_jump"], self.sliders["load"]
            torque = arguments["torque"]
            self.sliders["torque"] = Slider(
                "torque of the sun, N m", torque, (0.05 * torque, 5.0 * torque, 0.01 * torque)
            )
        if self.pin_errors:
            # Tangential.
            self.sliders["pin_error"] = Slider(
                "pin error of the first, µm", self.pin_errors[0][1], (-50.0, 50.0, 0.5), 1e-6
            )

    def sections(self, setting):
        """Return the sections of the configuration that change with what the sliders change."""
        moved = {
            name: getattr(setting, name)
            for name, one in self.sliders.items()
            if name in self._off or getattr(setting, name) != one.start
        }
        arguments = self.values["arguments"]
        flanks = {key: moved[key] for key in ("backlash", "load") if key in moved}
        kappa = 1.0 - moved["stiffness_jump"] if "stiffness_jump" in moved else None
        ratio = {} if kappa is None else {"stiffness_ratio": kappa}
        own = {}
        if "pin_error" in moved:
            first = [self.pin_errors[0][0], setting.pin_error]
            own = {"pin_errors": [first, *self.pin_errors[1:]]}
        if self.kind == "planetary":
            own |= flanks | {key: [value, value] for key, value in ratio.items()}
        elif self.kind == "planetary_set":
            own |= {"torque": moved["torque"]} if "torque" in moved else {}
            own |= {"backlashes": [setting.backlash] * 2} if "backlash" in moved else {}
        elif self.kind == "own":
            if "load" in moved:
                share = setting.load / self.start.load
                own["bodies"] = [
                    b | {"torque": share * b.get("torque", 0.0)} for b in arguments["bodies"]
                ]
            if teeth := ratio | {key: flanks[key] for key in ("backlash",) if key in flanks}:
                own["meshes"] = [mesh | teeth for mesh in arguments["meshes"]]
        elif "backlashes" in arguments and "backlash" in moved:
            own["backlashes"] = [[setting.backlash] * 2] * len(self.pin_errors)
        changed = {"train": {self.kind: own}} if own else {}
        if self._pair is None or not (flanks or ratio):
            return changed
        return changed | {"gear_pair": {**self._pair, **flanks, **ratio}}

    def whole(self, setting):
        """Return the configuration of what the sliders stand for."""
        whole = laid_over(self.mapping, self.sections(setting))
        if self.kind == "planetary_set" and setting.torque != self.start.torque:
            # The torque takes their place.
            drawn = dict(whole["train"][self.kind])
            for key in ("power", "speed"):
                drawn.pop(key, None)
            whole["train"] = {**whole["train"], self.kind: drawn}
        return whole

    def train(self, setting):
        """Return the `GearTrain` that the sliders stand for."""
        return described(**config.load(self.whole(setting)).train_parameters(self.damping))

    def rpm(self, setting):
        """Return the speed of the reference pinion at tuning 1, rpm."""
        return _rpm(self.train(setting))

    def configuration(self, setting):
        """Return the text of a config.yaml that describes what is seen."""
        head = f"at {setting.speed:g} rpm, damping {self.damping}."
        return saved(head, self.whole(setting))

    def look(self, setting):
        """Return the view of a setting."""
        train = self.train(setting)
        rpm = _rpm(train)
        return look(train, setting.speed / rpm, self.speeds / rpm, TRAIN)


def _rpm(train):
    """Return the speed of the reference pinion at tuning 1, rpm."""
    return float(train.speed_scales(1.0)["speed"])

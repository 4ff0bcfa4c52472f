"""From slider values to the arrays that the explorer draws of a drawn pair; no browser here."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
import yaml

from gearlib import config
from gearlib.config.gears import TWENTY, Gears
from gearlib.geometry import Mesh, TipRelief
from gearlib.models.load_sharing_pair import LoadSharingPair
from gearlib.models.pair import GearPair
from gearlib.pages.explorer import view

#: Where the sliders start if no gears are drawn: z 20/20, m 10 mm, b 30 mm, E 200 GPa
#: of the literature on backlash, under 106 N per mm of width.
START = TWENTY | {"backlash": 100e-6, "torque": 300.0}
#: Keys of a drawing that the sliders replace.
_REPLACED = "centre_distance", "torque", "power", "speed", "stiffness", "stiffness_options"
#: Keys of a gear that it starts without.
_BARE = "tip_relief", "pitch_errors"
#: Loads of the Harris map beside the chosen one, over that at the start.
_LOADS = 0.0, 0.5, 1.0, 1.5, 2.0
_PHASES = 256
#: Speeds of the characteristic, over that of resonance at the start.
_LOWEST, _HIGHEST = 0.2, 2.2
#: Length of the reliefs over the longest one, which leaves single contact its involutes.
LENGTHS = {"short": 0.5, "long": 1.0}
#: What moves, and speeds of its characteristic; of pairs of teeth each takes twenty times longer.
POINTS = {"rectangle": 500, "teeth": 60}


@dataclass(frozen=True)
class Setting:
    """What the sliders and choices say, in SI."""

    module: float
    pinion_shift: float
    wheel_shift: float
    relief: float  #: amount of the tip relief of both gears, m
    backlash: float  #: normal, m
    torque: float  #: of the pinion, N m
    speed: float  #: of the pinion, rpm
    damping: float  #: beta
    length: str = "short"  #: of the reliefs, one of `LENGTHS`
    model: str = "rectangle"  #: one of `POINTS`


@dataclass(frozen=True)
class View:
    """What is seen at one setting."""

    mesh: Mesh
    pair: GearPair  #: with the rectangle of the mesh stiffness
    error: xr.Dataset  #: of `Mesh.transmission_error` at `Drawing.loads`, the chosen one last
    motion: view.View


class Drawing:
    """A drawn spur pair, and what sliders change of it.

    Parameters
    ----------
    mapping : dict
        A configuration that `gearlib.config.load` accepts. Its gears, if it draws some, are where
        the sliders start, without tip relief and pitch errors; the centre distance follows the
        shifts.
    damping : str
        One of its dampings, whose ratios count.
    """

    def __init__(self, mapping, damping):
        self.section, self.damping = mapping.get("gears", START), damping
        gears = Gears.model_validate(self.section)
        self.drawn = mesh = gears.mesh()
        torque = float(f"{gears.pair()['load'] * mesh.pinion.base_diameter / 2.0:.6g}")
        pair = GearPair(**config.load(mapping).pair_parameters(damping))
        self.backlash_damping = pair.backlash_damping_ratio
        self.loads = torque * np.array(_LOADS)
        start = Setting(
            module=mesh.pinion.module,
            pinion_shift=mesh.pinion.shift,
            wheel_shift=mesh.wheel.shift,
            relief=0.0,
            backlash=mesh.backlash,
            torque=torque,
            speed=1.0,
            damping=pair.damping_ratio,
        )
        resonance = self.pair(start).speed(1.0)
        #: Lowest and highest speed, rpm.
        self.speeds = _LOWEST * resonance, _HIGHEST * resonance
        self.start = replace(start, speed=float(round(0.9 * resonance)))

    def mesh(self, setting):
        """Return the `Mesh` that the sliders stand for: tips stay as high above the shift."""
        pinion = self._gear("pinion", setting.module, setting.pinion_shift)
        wheel = self._gear("wheel", setting.module, setting.wheel_shift)
        mesh = Mesh(pinion, wheel, backlash=setting.backlash)
        if not setting.relief:
            return mesh
        length = LENGTHS[setting.length] * mesh.longest_relief
        relief = TipRelief(amount=setting.relief, length=length)
        return mesh.with_reliefs(relief, relief)

    def _gear(self, name, module, shift):
        gear = getattr(self.drawn, name)
        tip = gear.tip_diameter / gear.module + 2.0 * gear.sign * (shift - gear.shift)
        changes = {"module": module, "shift": shift, "tip_diameter": float(f"{tip * module:.12g}")}
        try:
            return replace(gear, **changes, tip_relief=None, pitch_errors=())
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None

    def pair(self, setting, kind=GearPair):
        """Return the `GearPair`, or another kind of pair, that the sliders stand for."""
        return kind.from_geometry(
            self.mesh(setting),
            torque=setting.torque,
            damping_ratio=setting.damping,
            backlash_damping_ratio=self.backlash_damping,
            stiffness="energy",
        )

    def look(self, setting):
        """Return the `View` of a setting.

        Raises
        ------
        ValueError
            If there cannot be such gears; the message names parameter, value and range.
        """
        mesh, pair = self.mesh(setting), self.pair(setting)
        error = mesh.transmission_error([*self.loads, setting.torque], phases=_PHASES)
        model = pair if setting.model == "rectangle" else self.pair(setting, LoadSharingPair)
        grid = pair.tuning_at(np.linspace(*self.speeds, POINTS[setting.model]))
        motion = view.look(model, pair.tuning_at(setting.speed), grid)
        return View(mesh, pair, error, motion)

    def configuration(self, setting):
        """Return the text of a config.yaml of these gears.

        All else of the configuration at the start is left out: it suits the gears that this has.
        """
        mesh = self.mesh(setting)
        gears = {key: value for key, value in self.section.items() if key not in _REPLACED}
        for name in ("pinion", "wheel"):
            gear = getattr(mesh, name)
            keys = ("module", "shift", "tip_diameter")
            own = {key: value for key, value in gears[name].items() if key not in _BARE}
            gears[name] = own | {key: getattr(gear, key) for key in keys}
            if setting.relief:
                length = float(f"{gear.tip_relief.length:.12g}")
                gears[name]["tip_relief"] = {"amount": setting.relief, "length": length}
        gears |= {"backlash": setting.backlash, "torque": setting.torque, "stiffness": "energy"}
        ratios = {
            "damping_ratio": setting.damping,
            "backlash_damping_ratio": self.backlash_damping,
        }
        whole = {
            "gears": gears,
            "dampings": {self.damping: ratios},
            "phase_planes": {"tunings": [float(self.pair(setting).tuning_at(setting.speed))]},
        }
        config.load(whole)
        head = f"# What gearlib explore showed at {setting.speed:g} rpm of the pinion."
        return f"{head}\n{yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)}"

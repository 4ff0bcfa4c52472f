"""From slider values to the arrays that the explorer draws of a drawn pair; no browser here."""

import math
from dataclasses import asdict, replace

import numpy as np

from gearlib import config
from gearlib.config.gears_section import TWENTY, Gears
from gearlib.geometry import Mesh, TipRelief
from gearlib.models.load_sharing_pair import tooth_pairs_of
from gearlib.models.pair import GearPair
from gearlib.pages.explorer.explored import Explored, Slider, saved, slider_of
from gearlib.pages.explorer.view import PAIR, look

#: Where the sliders start if no gears are drawn: z 20/20, m 10 mm, b 30 mm, E 200 GPa
#: of the literature on backlash, under 106 N per mm of width.
START = TWENTY | {"backlash": 100e-6, "torque": 300.0}
#: Keys of a drawing that the sliders replace.
_REPLACED = "centre_distance", "torque", "power", "speed"
#: Keys of a gear that a setting decides on.
_SET = "tip_relief", "pitch_errors"
#: Loads of the Harris map beside the chosen one, over that at the start.
_LOADS = 0.0, 0.5, 1.0, 1.5, 2.0
_PHASES = 256
#: Most phases where pitch errors make the error repeat after many mesh periods, and least of each.
_ALL_PHASES, _FEWEST = 2048, 16
#: Most mesh periods that are recorded of a motion.
_RECORDED = 100
#: Speeds of the characteristic, over that of resonance at the start.
_LOWEST, _HIGHEST = 0.2, 2.2
#: Length of the reliefs over the longest one, which leaves single contact its involutes.
LENGTHS = {"short": 0.5, "long": 1.0}
#: Where the drawing has relief: its lengths and shapes, amounts in their proportion.
OWN = "as drawn"
#: Speeds of the characteristic.
POINTS = 500


class Drawing(Explored):
    """A drawn spur pair, and what sliders change of it.

    Parameters
    ----------
    mapping : dict
        A configuration that `gearlib.config.load` accepts. Its gears, if it draws some, are where
        the sliders start; the centre distance follows the shifts.
    damping : str
        One of its dampings, whose ratios count.
    """

    def __init__(self, mapping, damping):
        self.section, self.damping = mapping.get("gears", START), damping
        gears = Gears.model_validate(self.section)
        self.drawn = mesh = gears.mesh()
        torque = float(f"{gears.pair()['load'] * mesh.pinion.base_diameter / 2.0:.6g}")
        pair = GearPair(**config.load(mapping).pair_parameters(damping))
        # Made of the coefficients: what was given comes back to 12 digits.
        beta, self.backlash_damping = (
            float(f"{ratio:.12g}") for ratio in (pair.damping_ratio, pair.backlash_damping_ratio)
        )
        self.loads = torque * np.array(_LOADS)
        pinion, wheel, gap = mesh.pinion, mesh.wheel, mesh.backlash
        reliefs = [one.tip_relief.amount for one in (pinion, wheel) if one.tip_relief]
        errors = bool(pinion.pitch_errors or wheel.pitch_errors)
        amount = max(reliefs, default=0.0)
        lengths = [OWN, *LENGTHS] if amount else [*LENGTHS]
        self.choices = {"length": ("length of the reliefs", lengths)}
        if errors:
            self.choices["errors"] = "pitch errors", {OWN: True, "none": False}
        self.heading = (
            f"Drawn gears, z {pinion.teeth}/{wheel.teeth}, module {1e3 * pinion.module:g} mm, "
            f"width {1e3 * pinion.width:g} mm, {torque:g} N m"
        )
        if self.section is START:
            self.heading += ": an example, since the configuration draws none"
        has = ["tip relief"] * bool(amount) + ["pitch errors"] * errors
        self.heading += f", {' and '.join(has)} as drawn" if has else ""
        self.heading += (
            ". The motion at the speed is that of pairs of teeth, the characteristic that of the "
            "rectangular stiffness."
        )
        module, shifts = 1e3 * pinion.module, (-1.0, 1.5, 0.01)
        self.sliders = {
            "module": Slider(
                "module, mm", pinion.module, (0.5 * module, 2.0 * module, 0.05 * module), 1e-3
            ),
            "pinion_shift": Slider("profile shift of the pinion", pinion.shift, shifts),
            "wheel_shift": Slider("profile shift of the wheel", wheel.shift, shifts),
            "relief": Slider(
                "largest tip relief, µm" if amount else "tip relief of both gears, µm",
                amount,
                (0.0, max(50.0, 2e6 * amount), 0.1),
                1e-6,
            ),
            "backlash": slider_of(
                GearPair, "backlash", gap, 1.0, high=max(400.0, 3e6 * gap), unit=1e-6
            ),
            "torque": Slider(
                "torque of the pinion, N m", torque, (0.05 * torque, 4.0 * torque, 0.01 * torque)
            ),
            "damping": Slider("damping ratio β", beta, (0.0, max(0.3, 2.0 * beta), 0.0005)),
        }
        resonance = self.pair(self.start).speed(1.0)
        #: Lowest and highest speed, rpm.
        given = gears.speed or resonance
        low, high = min(_LOWEST * resonance, given), max(_HIGHEST * resonance, given)
        self.speeds = low, high
        speed = Slider(
            "speed of the pinion, rpm",
            float(round(0.9 * resonance)),
            (float(math.ceil(low)), float(math.floor(high)), 1.0),
        )
        damping = self.sliders.pop("damping")
        self.sliders |= {"speed": speed, "damping": damping}

    def mesh(self, setting):
        """Return the `Mesh` that the sliders stand for: tips stay as high above the shift."""
        pinion = self._gear("pinion", setting, setting.pinion_shift)
        wheel = self._gear("wheel", setting, setting.wheel_shift)
        mesh = Mesh(pinion, wheel, backlash=setting.backlash)
        if not setting.relief:
            return mesh
        if setting.length == OWN:
            return mesh.with_reliefs(*(self._own(name, setting) for name in ("pinion", "wheel")))
        length = LENGTHS[setting.length] * mesh.longest_relief
        relief = TipRelief(amount=setting.relief, length=length)
        return mesh.with_reliefs(relief, relief)

    def _own(self, name, setting):
        """Return the relief of the drawing: the larger, the more there is; as long in modules."""
        own = getattr(self.drawn, name).tip_relief
        if own is None:
            return None
        share = setting.relief / self.start.relief, setting.module / self.start.module
        return replace(own, amount=own.amount * share[0], length=own.length * share[1])

    def _gear(self, name, setting, shift):
        gear, module = getattr(self.drawn, name), setting.module
        tip = gear.tip_diameter / gear.module + 2.0 * gear.sign * (shift - gear.shift)
        changes = {"module": module, "shift": shift, "tip_diameter": float(f"{tip * module:.12g}")}
        try:
            errors = gear.pitch_errors if getattr(setting, "errors", False) else ()
            return replace(gear, **changes, tip_relief=None, pitch_errors=errors)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None

    def _load(self, setting):
        return {
            "torque": setting.torque,
            "damping_ratio": setting.damping,
            "backlash_damping_ratio": self.backlash_damping,
            "options": self.section.get("stiffness_options"),
        }

    def pair(self, setting):
        """Return the `GearPair` that the sliders stand for."""
        stiffness = self.section.get("stiffness") or "iso"
        return GearPair.from_geometry(
            self.mesh(setting), stiffness=stiffness, **self._load(setting)
        )

    def teeth(self, setting):
        """Return the `LoadSharingPair` that the sliders stand for."""
        stiffness = self.section.get("stiffness")
        return tooth_pairs_of(self.mesh(setting), stiffness=stiffness, **self._load(setting))

    def look(self, setting):
        """Return the view of a setting; ValueError if there cannot be such gears."""
        mesh, pair = self.mesh(setting), self.pair(setting)
        # After so many mesh periods the same teeth meet again.
        count = len(mesh.pitch_errors)
        phases = max(_FEWEST, min(_PHASES, _ALL_PHASES // count))
        teeth = self.teeth(setting)
        torques, stiffness = [*self.loads, setting.torque], teeth.stiffness
        error = mesh.transmission_error(torques, phases=phases, stiffness=stiffness)
        grid = pair.tuning_at(np.linspace(*self.speeds, POINTS))
        more = max(0, min(count, _RECORDED) - PAIR.recorded)
        lengths = PAIR._replace(
            **{key: getattr(PAIR, key) + more for key in ("periods", "recorded", "settle")}
        )
        tuning = teeth.tuning_at(setting.speed)
        return look(pair, tuning, grid, lengths, moving=teeth, mesh=mesh, pair=pair, error=error)

    def configuration(self, setting):
        """Return the text of a config.yaml of these gears.

        All else of the configuration at the start is left out: it suits the gears that this has.
        """
        mesh = self.mesh(setting)
        gears = {key: value for key, value in self.section.items() if key not in _REPLACED}
        for name in ("pinion", "wheel"):
            gear = getattr(mesh, name)
            keys = ("module", "shift", "tip_diameter")
            own = {key: value for key, value in gears[name].items() if key not in _SET}
            gears[name] = own | {key: getattr(gear, key) for key in keys}
            if gear.tip_relief:
                said = asdict(gear.tip_relief)
                rounded = {key: float(f"{said[key]:.12g}") for key in ("amount", "length")}
                gears[name]["tip_relief"] = said | rounded
            if gear.pitch_errors:
                gears[name]["pitch_errors"] = list(gear.pitch_errors)
        gears |= {"backlash": setting.backlash, "torque": setting.torque}
        ratios = {
            "damping_ratio": setting.damping,
            "backlash_damping_ratio": self.backlash_damping,
        }
        whole = {
            "gears": gears,
            "dampings": {self.damping: ratios},
            "phase_planes": {"tunings": [float(self.pair(setting).tuning_at(setting.speed))]},
        }
        return saved(f"at {setting.speed:g} rpm of the pinion.", whole)

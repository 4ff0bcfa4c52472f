"""`GearTrain`: bodies, shafts and meshes as one piecewise-linear model."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearlib import checks
from gearlib.models.model import Model
from gearlib.models.trains import turning, waves
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.structure import free_motions, structure

#: Of the static deflection where the reference mesh carries no load, m.
_FALLBACK = 1e-6
#: Relative difference of base pitches that is rounding of base radii.
_PITCH = 1e-4


@dataclass(frozen=True, kw_only=True)
class GearTrain(Model):
    """Any number of gears in mesh, in SI units; immutable.

    Parameters
    ----------
    bodies : sequence of Body
    meshes : sequence of Mesh
    shafts : sequence of Shaft, default none
    reference : str, optional
        Name of the mesh that sets scales, mesh phase and tuning; by default the first.
    reference_frequency : float, optional
        Hz, what the tuning is counted in; by default that of the elastic mode with the most strain
        energy in the reference mesh, with mean stiffness and all flanks in contact.
    carrier_ratio : float, default 0
        Speed of the frame in which positions are given, over that of the reference pinion in this
        frame; not 0 where a carrier turns.
    gyroscopic : bool, default False
        Whether the forces of the turning frame act on axes that can move.

    Raises
    ------
    ValueError
        If a value is impossible or the train cannot be assembled, turn, or stay in balance.
    """

    bodies: tuple
    meshes: tuple
    shafts: tuple = ()
    reference: str | None = None
    reference_frequency: float | None = None
    carrier_ratio: float = 0.0
    gyroscopic: bool = False

    mathematics = {"exact": "several_meshes"}
    free_rotation = True
    title_noun = "a gear train"
    references = (
        "Lin, Parker: J. Vib. Acoust. 121 (1999) 316-321; "
        "Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104"
    )

    def __post_init__(self):
        for name, kind in (("bodies", Body), ("meshes", Mesh), ("shafts", Shaft)):
            values = getattr(self, name)
            least = 0 if name == "shafts" else 1
            if (
                not isinstance(values, (tuple, list))
                or len(values) < least
                or not all(isinstance(value, kind) for value in values)
            ):
                raise ValueError(
                    f"{name} = {values!r} is not allowed: it must be a sequence of {kind.__name__}"
                )
            object.__setattr__(self, name, tuple(values))
        for name in ("bodies", "meshes"):
            names = [value.name for value in getattr(self, name)]
            twice = next((one for one in names if names.count(one) > 1), None)
            if twice is not None:
                raise ValueError(
                    f"{name} = {names!r} is not allowed: the name {twice!r} must occur once"
                )
        if self.reference is None:
            object.__setattr__(self, "reference", self.meshes[0].name)
        checks.one_of("reference", self.reference, self.mesh_names)
        ratio = checks.number("carrier_ratio", self.carrier_ratio, "finite", math.isfinite)
        object.__setattr__(self, "carrier_ratio", ratio)
        checks.one_of("gyroscopic", self.gyroscopic, (False, True))
        if self.reference_frequency is not None:
            value = checks.finite_positive("reference_frequency", self.reference_frequency)
            object.__setattr__(self, "reference_frequency", value)
        self._check_names()
        self._check_gears()
        self._check_balance()

    def _check_names(self):
        for shaft in self.shafts:
            for name in shaft.bodies:
                checks.one_of("bodies of a shaft", name, self.body_names)
        for mesh in self.meshes:
            for side in ("pinion", "wheel"):
                name = getattr(mesh, side)
                checks.one_of(f"{side} of mesh {mesh.name}", name, self.body_names)
            if mesh.pinion == mesh.wheel:
                raise ValueError(
                    f"wheel of mesh {mesh.name} = {mesh.wheel!r} is not allowed: it must be "
                    "another body than the pinion"
                )
        for body in self.bodies:
            if body.carrier is not None:
                checks.one_of(f"carrier of body {body.name}", body.carrier, self.body_names)
                if body.carrier == body.name or self.by_name[body.carrier].carrier is not None:
                    raise ValueError(
                        f"carrier of body {body.name} = {body.carrier!r} is not allowed: it must "
                        "be another body, which no carrier carries"
                    )
            equal = all(
                len(set(getattr(body, f"support_{name}"))) == 1 for name in ("stiffness", "damping")
            )
            if self.gyroscopic and body.carrier is None and not equal:
                raise ValueError(
                    f"support_stiffness of body {body.name} = {body.support_stiffness!r} is not "
                    "allowed: it must be, as its damping, the same along x and y in a turning frame"
                )

    def _check_gears(self):
        for mesh in self.meshes:
            pinion, wheel = self.by_name[mesh.pinion], self.by_name[mesh.wheel]
            for body in (pinion, wheel):
                if body.teeth is None:
                    raise ValueError(
                        f"teeth of body {body.name} = None is not allowed: it must be an integer "
                        f">= 3, because it is in mesh {mesh.name}"
                    )
            pitches = [2.0 * math.pi * body.base_radius / body.teeth for body in (pinion, wheel)]
            if abs(pitches[0] - pitches[1]) > _PITCH * max(pitches):
                raise ValueError(
                    f"base_radius of body {wheel.name} = {wheel.base_radius!r} is not allowed: it "
                    f"must be {pinion.base_radius * wheel.teeth / pinion.teeth:.6g} to have the "
                    f"base pitch (module) of {pinion.name} in mesh {mesh.name}"
                )
            if mesh.internal and wheel.teeth <= pinion.teeth:
                raise ValueError(
                    f"teeth of body {wheel.name} = {wheel.teeth!r} is not allowed: it must be more "
                    f"than the {pinion.teeth} of {pinion.name}, which meshes inside it"
                )
        self.phases  # noqa: B018 (refuses what does not turn or fit)

    def _check_balance(self):
        if not self.structure.coordinates:
            raise ValueError("bodies is not allowed: at least one of them must be able to move")
        mass = self.structure.mass
        if np.linalg.eigvalsh(mass)[0] <= 0.0:
            raise ValueError("bodies is not allowed: every motion must have a mass")
        load = self.structure.load
        for motion in self.free_motions.T:
            work = motion * load
            if abs(work.sum()) > 1e-9 * np.abs(work).sum():
                turned = [
                    body.name
                    for body, rows in zip(self.bodies, self.structure.motions, strict=True)
                    if np.abs(rows @ motion).max() > 1e-6 * np.abs(motion).max()
                ]
                raise ValueError(
                    f"torque of bodies {', '.join(turned)} is not allowed: they must balance on "
                    "the free rotation of the train, whose power is now "
                    f"{work.sum() / np.abs(work).sum():.3g} of that of the single torques"
                )

    # What follows is computed once.

    @property
    def body_names(self):
        """Names of the bodies."""
        return tuple(body.name for body in self.bodies)

    @property
    def mesh_names(self):
        """Names of the meshes."""
        return tuple(mesh.name for mesh in self.meshes)

    @cached_property
    def by_name(self):
        """Name -> `Body`."""
        return {body.name: body for body in self.bodies}

    @cached_property
    def structure(self):
        """The `Structure`: matrices in SI units."""
        return structure(self.by_name, self.meshes, self.shafts)

    @cached_property
    def speeds(self):
        """Name of a body -> its speed by reference mesh phase, a signed `Fraction`."""
        return turning.speeds(self.by_name, self.meshes, self.shafts, self.reference)

    @cached_property
    def rates(self):
        """Mesh frequencies over that of the reference mesh, `Fraction`."""
        return tuple(
            abs(self.speeds[mesh.pinion]) * self.by_name[mesh.pinion].teeth for mesh in self.meshes
        )

    @cached_property
    def phases(self):
        """Name of a mesh -> phase of its stiffness in its mesh periods."""
        return turning.phases(self.by_name, self.meshes, self.shafts, self.reference, self.speeds)

    @cached_property
    def repeats(self):
        """Reference mesh periods after which stiffness, deviations and run-out repeat."""
        return waves.common_period(self)

    @cached_property
    def excitation(self):
        """Deviations, run-out and errors, see `waves.excitation`."""
        return waves.excitation(self)

    @cached_property
    def stretches(self):
        """Segments of constant stiffness, see `waves.stretches`."""
        drive = [self.phases[mesh.name] for mesh in self.meshes]
        coast = [
            g if mesh.inverse_phase is None else mesh.inverse_phase % 1.0
            for g, mesh in zip(drive, self.meshes, strict=True)
        ]
        both = list(zip(coast, drive, strict=True))
        return waves.stretches(self.meshes, self.rates, both, self.repeats)

    @property
    def size(self):
        """Components that vary: coordinates and their rates."""
        return 2 * len(self.structure.coordinates)

    @cached_property
    def mean_stiffness_matrix(self):
        """Stiffness with all flanks in contact at mean stiffness, N/m."""
        lines = self.structure.lines
        means = np.array([mesh.mean_stiffness for mesh in self.meshes])
        return self.structure.stiffness + lines.T @ (means[:, None] * lines)

    @cached_property
    def _linear(self):
        return free_motions(self.mean_stiffness_matrix, self.structure.mass)

    @property
    def free_motions(self):
        """Motions of the train that no stiffness resists, mass-normalised, shape (n, k)."""
        return self._linear[0]

    @cached_property
    def linear_modes(self):
        """(squared angular frequencies, mass-normalised shapes) of the elastic modes."""
        return self._linear[1:]

    @property
    def reference_mesh(self):
        """The `Mesh` that sets scales, phase and tuning."""
        return self.meshes[self.mesh_names.index(self.reference)]

    @property
    def reference_pinion(self):
        """The `Body` whose revolutions are counted."""
        return self.by_name[self.reference_mesh.pinion]

    @property
    def stiffness_scale(self):
        """Mean stiffness of the reference mesh, N/m."""
        return self.reference_mesh.mean_stiffness

    @cached_property
    def static_deflection(self):
        """Static force in the reference mesh over its mean stiffness, m; 1 um without load.

        The force is that of the linear train: mean stiffness, all flanks in contact, no errors.
        """
        squares, shapes = self.linear_modes
        deflection = shapes @ ((shapes.T @ self.structure.load) / squares)
        lines = self.structure.lines
        own = lines[self.mesh_names.index(self.reference)]
        value = abs(own @ deflection)
        largest = np.abs(shapes @ ((shapes.T @ np.abs(self.structure.load)) / squares)).max()
        return float(value) if value > 1e-9 * largest else _FALLBACK

    @property
    def load(self):
        """Static deflection times mean stiffness of the reference mesh, N."""
        return self.static_deflection * self.stiffness_scale

    @cached_property
    def reference_angular_frequency(self):
        """What the tuning is counted in, rad/s."""
        if self.reference_frequency is not None:
            return 2.0 * math.pi * self.reference_frequency
        squares, shapes = self.linear_modes
        own = self.structure.lines[self.mesh_names.index(self.reference)]
        share = (own @ shapes) ** 2 / squares
        # Modes of one frequency are one: in them the energy may lie in any direction.
        together = [share[np.abs(squares - w) < 1e-6 * w].sum() for w in squares]
        return math.sqrt(squares[int(np.argmax(np.array(together) > 0.999999 * max(together)))])

    def mesh_frequency(self, tuning):
        """Return the angular frequency of the reference mesh, rad/s (float or array)."""
        return tuning * self.reference_angular_frequency

    def scales(self):
        """Return the scalar variables of datasets that depend on the train alone."""
        return {
            "static_deflection": self.static_deflection,
            "force_scale": self.load,
            "stiffness_scale": self.stiffness_scale,
        }

    def speed_scales(self, tuning):
        """Return the variables of datasets that depend on the tuning (float or array)."""
        frequency = self.mesh_frequency(tuning)
        turns = frequency / (2.0 * math.pi) / self.reference_pinion.teeth
        return {
            "mesh_frequency": frequency,
            "velocity_scale": self.static_deflection * frequency,
            "acceleration_scale": self.static_deflection * frequency**2,
            "speed": 60.0 * turns * abs(1.0 + self.carrier_ratio),
        }

    def damped(self):
        """Return whether there is any damping on the way of the motion."""
        meshes = any(mesh.material_damping or mesh.backlash_damping for mesh in self.meshes)
        return meshes or bool(self.structure.damping.any())

    def system(self, tuning):
        """Return the `TrainSystem` of the kernels at one tuning."""
        from gearlib.models.trains.system import train_system

        return train_system(self, tuning)

    def start_state(self, initial_state, tuning):
        """Return the state (q, dq/dtheta) at tau = 0, shape (size,).

        Parameters
        ----------
        initial_state : pair of 0, "static", or array_like of float, shape (size,)
            (0, 0): at rest, every flank just touching where there are no errors; "static": at
            rest in static equilibrium under the stiffness at tau = 0.
        tuning : float

        Raises
        ------
        ValueError
            If it is none of these.
        """
        if isinstance(initial_state, str):
            checks.one_of("initial_state", initial_state, ("static",))
            from gearlib.models.trains.statics import equilibrium

            state = np.zeros(self.size)
            state[: self.size // 2] = equilibrium(self).q / self.static_deflection
            return state
        state = np.asarray(initial_state, float)
        if state.shape == (2,) and not state.any():
            return np.zeros(self.size)
        if state.shape != (self.size,) or not np.all(np.isfinite(state)):
            raise ValueError(
                f"initial_state = {initial_state!r} is not allowed: it must be (0, 0), 'static' or "
                f"{self.size} finite numbers"
            )
        return state.copy()

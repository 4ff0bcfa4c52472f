"""`TwoGears`: a pair of six degrees of freedom as a train, of which all its matrices are made.

The line of action lies along x: the bearings y of the pair are the supports along x, its bearings
z, a quarter turn on, those along y. The train has the scales of the pair, whatever its torques.
"""

from dataclasses import dataclass
from typing import Any

from gearlib import checks
from gearlib.models.model import unchecked
from gearlib.models.trains import waves
from gearlib.models.trains.elements import Body, Mesh
from gearlib.models.trains.structure import FLOATS, Numbers, structure
from gearlib.models.trains.train import GearTrain

#: What the mesh takes of a `GearPair`, and of a `SixDegreePair`.
_OF_PAIR = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
_OF_PAIR += ("material_damping", "backlash_damping")
_OF_GEARS = ("deviation", "inverse_deviation", "friction", "pitch_phase", "moving_backlash")


class _Mesh(Mesh):
    """A mesh of which equal levels are told apart too, as those of a `GearPair` are."""

    two_levels = True


@dataclass(frozen=True, kw_only=True)
class TwoGears(GearTrain):
    """The train of a `SixDegreePair`; no check sees it.

    Parameters
    ----------
    gears : SixDegreePair
    numbers : Numbers, optional
        Of the run-out; by default floats.
    """

    gears: Any
    numbers: Numbers = FLOATS
    bodies: tuple = ()
    meshes: tuple = ()

    def __post_init__(self):
        gears = self.gears
        quarter = self.numbers.pi / 2.0
        # e3 sin phi3 and -e2 sin(Delta - phi2), where the gears turn in opposite directions.
        turned = -quarter, self.numbers.of(gears.run_out_phase) - quarter
        bodies = tuple(
            unchecked(
                Body,
                name=name,
                teeth=gears.teeth[i],
                base_radius=gears.base_radii[i],
                inertia=gears.inertias[i],
                mass=gears.masses[i],
                torque=gears.torques[i],
                support_stiffness=gears.bearing_stiffness[2 * i : 2 * i + 2],
                support_damping=gears.bearing_damping[2 * i : 2 * i + 2],
                eccentricity=gears.eccentricities[i],
                eccentricity_phase=turned[i],
            )
            for i, name in enumerate("32")
        )
        checks.known_damping(gears.pair.material_damping)
        values = {name: getattr(gears.pair, name) for name in _OF_PAIR}
        values |= {name: getattr(gears, name) for name in _OF_GEARS}
        mesh = unchecked(
            _Mesh, name="mesh", pinion="3", wheel="2", line_of_action=0.0, phase=0.0, **values
        )
        for name, value in (("bodies", bodies), ("meshes", (mesh,)), ("reference", "mesh")):
            object.__setattr__(self, name, value)

    def assembled(self, numbers=FLOATS):
        """Return the `Structure` in a kind of numbers: rotations, then bearings."""
        return structure(self.by_name, self.meshes, (), numbers, rotations_first=True)

    def segments_of(self, first, count):
        """Return the `Segments` of one mesh period: the run-out changes nothing in them."""
        return waves.segments(self, 0, 1)

    @property
    def static_deflection(self):
        """That of the pair."""
        return self.gears.static_deflection

    @property
    def reference_angular_frequency(self):
        """That of the pair."""
        return self.gears.mean_eigenfrequency

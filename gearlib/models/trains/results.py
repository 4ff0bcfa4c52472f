"""What runs of a gear train record: tables of the kernels, dimensions and variables of datasets."""

import math
from functools import cached_property
from typing import Any

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.record import FORCE_SUM, SUMMARY_COLUMNS
from gearlib.models.model import Model
from gearlib.models.one_mesh_system import contact_map
from gearlib.models.trains import layout, train_values
from gearlib.models.trains.statics import branches
from gearlib.models.trains.structure import AXES
from gearlib.models.trains.train_parameters import PARAMETERS, value_of, with_value


class TrainResults(Model):
    """The part of `GearTrain` that runs ask for their results."""

    #: Fields and properties of `GearTrain`.
    meshes: Any
    structure: Any
    static_deflection: Any
    body_names: Any
    linear_modes: Any
    loaded_stretches: Any
    free_motions: Any
    load: Any
    gyroscopic: Any
    start_state: Any
    train = property(lambda self: self, doc="The train itself.")

    @property
    def components(self):
        """Names of the components of the state: coordinates, then their rates by phase."""
        names = [f"{body} {axis}" for body, axis in self.structure.coordinates]
        return (*names, *(f"{name}'" for name in names))

    @property
    def flank_lines(self):
        """Displacements at which drive- and coast-side contact begin, a row each, shape (2, m)."""
        backlash = np.array([mesh.backlash for mesh in self.meshes])
        return np.stack([np.zeros(backlash.size), -backlash / self.static_deflection])

    def check_state(self, value):
        """Return an initial state, checked, as of `start_state`."""
        state = self.start_state(value)
        return value if isinstance(value, str) else tuple(map(float, np.ravel(value)[: state.size]))

    parameters, parameter, with_parameter = PARAMETERS, value_of, with_value
    settable = property(train_values.settable, doc="See `Model.settable`.")
    value, with_values = train_values.value, train_values.with_values
    contact_map = contact_map

    def disturbed(self, state, disturbance):
        """Return an initial state with so much added to the first coordinate that can bend."""
        state = self.start_state(state)
        _, lift = self.reduction()
        return tuple(map(float, state + disturbance * lift[:, 0]))

    def coordinates(self):
        """Return name -> values of the dimensions of results."""
        return {
            "component": list(self.components),
            "mesh": list(self.mesh_names),
            "body": list(self.body_names),
            "axis": list(AXES),
        }

    def empty_record(self, samples=0, events=16):
        """Return empty tables for the record of a run, see `Model.empty_record`.

        Samples have six columns for each mesh, then the coordinates.
        """
        m = len(self.meshes)
        columns = m * orbit.SAMPLE_COLUMNS + self.size // 2
        shapes = (samples, columns), (events, EVENT_COLUMNS), (m, SUMMARY_COLUMNS)
        return tuple(np.empty(shape) for shape in shapes)

    def more_samples(self, samples):
        """Return the motions of the bodies from the samples of `empty_record`."""
        q = samples[:, samples.shape[1] - self.size // 2 :]
        motion = np.einsum("bax,kx->kba", self.structure.motions, q)
        return {"body_motion": (("phase", "body", "axis"), motion)}

    def more_summary(self, dims, table, span):
        """Return mean forces, dynamic factors and load sharing of summaries, shape (..., m, 10).

        Dynamic factors are largest forces over those of the static equilibrium of the linear train;
        NaN in a mesh that it leaves without load.
        """
        mean = table[..., FORCE_SUM] / span
        static = self.mean_forces
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(static > 0.0, table[..., orbit.FORCE_MAX] / static, math.nan)
            shares = np.empty_like(mean)
            groups = branches(self)
            for group in set(groups):
                own = [j for j, other in enumerate(groups) if other == group]
                shares[..., own] = mean[..., own] / mean[..., own].mean(axis=-1, keepdims=True)
        columns = {"mean_force": mean, "dynamic_factor": factor, "load_sharing": shares}
        return {name: (dims, values) for name, values in columns.items()}

    def layout(self):
        """Return where the gears lie, without errors of assembly, and how they turn.

        Positions, pins and shafts lead from axis to axis; x = y = 0 is that of the first carrier,
        without one that of the first body.

        Returns
        -------
        xarray.Dataset
            Over `body`: body_x, body_y, body_radius (m), body_turns, carried_by, shaft_line; over
            `mesh`: mesh_x, mesh_y (m) and, over `gear` too, mesh_gear, pitch_radius (m); and
            frame_turns, misfit (m). Turns are in the housing, over the phase of the reference mesh.
        """
        return layout.layout(self)

    @property
    def mean_forces(self):
        """Static forces of the linear train, without errors, over the load, shape (m,)."""
        means = np.array([mesh.mean_stiffness for mesh in self.meshes])
        return means * self.loaded_stretches / self.load

    def reduction(self):
        """Return (reduce, lift), see `Model.reduction`: elastic modes span what is left.

        Raises
        ------
        ValueError
            If a free rotation is damped or feels the turning of the frame: then it is not neutral.
        """
        return self._reduction

    @cached_property
    def _reduction(self):
        free, (_, shapes) = self.free_motions, self.linear_modes
        structure = self.structure
        forces = [structure.damping, structure.turning] if self.gyroscopic else [structure.damping]
        # Against the parts that cancel, so that nothing is small beside a stiff shaft.
        if any((np.abs(a @ free) > 1e-9 * (np.abs(a) @ np.abs(free))).any() for a in forces):
            raise ValueError(
                "this train is not allowed here: its free rotation must feel neither damping nor "
                "gyroscopic forces"
            )
        # Columns of largest entry 1, so that residuals count in static deflections.
        scale = np.abs(shapes).max(axis=0)
        half_reduce = (structure.mass @ shapes * scale).T
        half_lift = shapes / scale
        found = np.kron(np.eye(2), half_reduce), np.kron(np.eye(2), half_lift)
        for matrix in found:
            matrix.flags.writeable = False
        return found

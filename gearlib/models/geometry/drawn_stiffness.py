"""Mesh stiffness from the drawing: named choices, their sources, and what a model takes of them.

Over a mesh period, floor(eps_alpha) + 1 pairs touch on the segment eps_alpha - floor(eps_alpha),
one pair less on the rest. A position u in base pitches after the start of contact of the last pair
has the mesh phase 2 pi (u - half of that segment). The stiffness of a helical gear is the average
of that course over the overlap ratio eps_beta, because the slices of the face are in mesh one after
another: of the rectangle an exact trapezoid.
"""

import math
from dataclasses import dataclass

import numpy as np

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.energy import energy_stiffness
from gearlib.models.geometry.iso import iso_rectangle, pair_stiffness
from gearlib.models.profiles import Rectangular, Tabulated

#: Phase, in base pitches, that a step of the stiffness takes in a table, where it has to be a ramp.
_RAMP = 1e-7

SOURCES = {
    "iso": "ISO 6336-1, method B",
    "energy": "energy method, body after Sainsot, Velex & Duverger (2004)",
    "table": "a table of one's own",
}
#: Relative. "iso": the bounds quoted for its c', +5 % and -8 %. "energy": what contact and body
#: leave open; of four drawn pairs a logarithmic contact moves the mean by -12 to -20 %, a body for
#: each pair by +23 to +30 %.
UNCERTAINTY = {"iso": 0.08, "energy": 0.25, "table": math.nan}


@dataclass(frozen=True)
class MeshStiffness:
    """The stiffness of a mesh and what `GearPair` and `OneDegreePair` take of it."""

    method: str  #: "iso", "energy" or "table"
    max_stiffness: float  #: C_max, N/m
    stiffness_ratio: float  #: kappa
    contact_ratio: float  #: epsilon, from 1 to 2, of the rectangle
    profile: Rectangular | Tabulated  #: its course over the mesh phase

    @property
    def source(self):
        """Where the method comes from."""
        return SOURCES[self.method]

    @property
    def uncertainty(self):
        """Relative uncertainty of the method; NaN: not known."""
        return UNCERTAINTY[self.method]

    @property
    def mean_stiffness(self):
        """C_s, N/m, Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    def ratios(self):
        """Return max_stiffness, stiffness_ratio and contact_ratio as arguments of a `GearPair`."""
        names = ("max_stiffness", "stiffness_ratio", "contact_ratio")
        return {name: getattr(self, name) for name in names}


def mesh_stiffness(mesh, method="iso", *, samples=64, **options):
    """Return the `MeshStiffness` of a mesh.

    Parameters
    ----------
    mesh : Mesh
    method : {"iso", "energy"} or Tabulated, default "iso"
        "iso": c' of ISO 6336-1 for one pair of teeth, and for each more 0.75 c', so that the mean
        is c_gamma_alpha. "energy": the course by the energy method; its rectangle has the mean of
        each segment. A table stands for itself; its rectangle has its extrema and mean.
    samples : int, default 64
        Phases of the course by the energy method, >= 8.
    torque : float, optional
        Of the pinion, N m; matters to "iso" at low load, and to the logarithmic contact.
    application_factor : float, default 1
        K_A, of "iso".
    coupling, hertz
        Of "energy", see `energy_stiffness`.

    Raises
    ------
    ValueError
        If the method or an option is not allowed.
    """
    checks.drawn_mesh(mesh)
    if isinstance(method, Tabulated):
        checks.known("table", options, ("torque",))
        return _of_table("table", method)
    if method not in ("iso", "energy"):
        raise checks.refusal("stiffness", method, "'iso', 'energy' or a Tabulated")
    less = math.floor(mesh.contact_ratio)
    segment = mesh.contact_ratio - less
    if method == "iso":
        high, ratio, contact = iso_rectangle(mesh, **options)
        if mesh.overlap_ratio == 0.0:
            return MeshStiffness(method, high, ratio, contact, Rectangular())
        single = pair_stiffness(mesh, **options)
        levels = [single * (0.25 + 0.75 * count) for count in (less + 1, less)]
        course = _Course([0.0, segment, segment, 1.0], np.repeat(levels, 2))
        table = course.over_face(mesh.overlap_ratio).table(segment)
        return MeshStiffness(method, high, ratio, contact, table)
    checks.known("stiffness 'energy'", options, ("torque", "coupling", "hertz"))
    course, means = _energy_course(mesh, less, segment, samples, options)
    if mesh.overlap_ratio > 0.0:
        return _of_table(method, course.over_face(mesh.overlap_ratio).table(segment))
    profile = course.table(segment)
    return MeshStiffness(method, means[0], means[1] / means[0], 1.0 + segment, profile)


def _energy_course(mesh, less, segment, samples, options):
    """Return the course by the energy method, and its means on both segments."""
    samples = checks.integer("samples", samples, 8, 100_000)
    u, values, means = [], [], []
    for start, end, count in ((0.0, segment, less + 1), (segment, 1.0, less)):
        # Each segment gets its share of the phases, and enough for the mean of a parabola.
        n = max(5, round(samples * (end - start)))
        at = np.linspace(start, end, n)
        u.append(at)
        values.append(energy_stiffness(mesh, at, count, **options))
        means.append(float(np.trapezoid(values[-1], np.linspace(0.0, 1.0, n))))
    return _Course(np.concatenate(u), np.concatenate(values)), means


def _of_table(method, table):
    high, ratio, contact = table.ratios()
    if 1.0 - ratio < 1e-12:  # constant up to rounding, as with a whole overlap ratio
        ratio, contact = 1.0, 1.5
    return MeshStiffness(method, high, ratio, contact, table)


class _Course:
    """A stiffness over one base pitch: straight lines between points, which repeat at a step."""

    def __init__(self, u, values):
        self.u, self.values = np.asarray(u, float), np.asarray(values, float)
        steps = np.diff(self.u)
        areas = np.concatenate([[0.0], np.cumsum(steps * (self.values[1:] + self.values[:-1]) / 2)])
        self._areas = areas

    def integral(self, u):
        """Return the integral from 0 to `u`, which may lie outside of the base pitch."""
        whole = np.floor(u)
        fraction = u - whole
        i = np.clip(np.searchsorted(self.u, fraction, side="right") - 1, 0, self.u.size - 2)
        length = self.u[i + 1] - self.u[i]
        slope = (self.values[i + 1] - self.values[i]) / np.where(length > 0.0, length, 1.0)
        beyond = fraction - self.u[i]
        inner = self._areas[i] + beyond * (self.values[i] + slope * beyond / 2.0)
        return whole * self._areas[-1] + inner

    def over_face(self, overlap):
        """Return the average over `overlap` base pitches; exact where the course is rectangular."""
        half = overlap / 2.0
        # The average has its corners where a window begins or ends at a step.
        step = np.isin(self.u, [0.0, 1.0, *self.u[1:][np.diff(self.u) == 0.0]])
        at = [self.u[~step], self.u[step] - half, self.u[step] + half]
        at = np.sort(np.concatenate(at) % 1.0)
        # Corners that coincide up to rounding are one.
        at = at[np.diff(at, append=at[0] + 1.0) > 1e-12]
        return _Course(at, (self.integral(at + half) - self.integral(at - half)) / overlap)

    def table(self, segment):
        """Return the course as `Tabulated`; a step becomes a ramp."""
        u, values = self.u.copy(), self.values
        if u[-1] == 1.0:
            u[-1] -= _RAMP
        jumps = np.nonzero(np.diff(u) == 0.0)[0] + 1
        u[jumps] += _RAMP
        kept = np.concatenate([[True], np.diff(u) > 0.0])
        phase = math.tau * ((u[kept] - segment / 2.0) % 1.0)
        # A phase just below 0 rounds to a whole turn.
        phase, order = np.unique(np.where(phase < math.tau, phase, 0.0), return_index=True)
        return Tabulated(phase, values[kept][order])

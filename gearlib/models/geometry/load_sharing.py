"""How the pairs of teeth in mesh share the load: gaps, compliances, and the exact equilibrium.

With the displacement x along the line of action, the forces F_i of the pairs and their gaps g_i,

    x - g_i = sum_j Q_ij F_j  and  F_i > 0   of pairs that touch,
    x - g_i <= sum_j Q_ij F_j  and  F_i = 0  of the others,        sum F_i = F.

Without common bodies Q is diagonal and a pair carries c_i (x - g_i)+. Q is positive definite, so
one set of touching pairs fulfils all conditions at each phase and load: all sets are solved at
once, and the one that holds is taken. There is no iteration.

A pair touches between both ends of the path of contact only: contact of the tip's edge before or
behind them is left out. Sources: Harris, Proc. Inst. Mech. Eng. 172 (1958) 87-112; Q as of
`gearlib.models.geometry.energy`.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from gearlib import checks
from gearlib.models.geometry.energy import PairCompliance, matrix
from gearlib.models.geometry.iso import iso_stiffness
from gearlib.models.geometry.relief import PathTable

#: Places closer than this share of a base pitch are one.
_SAME_PLACE = 1e-12


@dataclass(frozen=True)
class Sharing:
    """Equilibrium under loads: l loads, m phases, k pairs."""

    error: np.ndarray  #: x, m, shape (l, m)
    force: np.ndarray  #: of each pair, N, shape (l, m, k)
    touching: np.ndarray  #: bool, shape (l, m, k)
    stiffness: np.ndarray  #: dF/dx, N/m, shape (l, m)


@dataclass(frozen=True)
class ToothPairs:
    """The pairs of teeth in mesh at m phases, k at most; pair 0 is the last that came into mesh."""

    pitches: np.ndarray  #: base pitches since pair 0 of the first mesh period, shape (m,)
    position: np.ndarray  #: on the path of contact, m, shape (m, k)
    inside: np.ndarray  #: bool, whether between its ends, shape (m, k)
    compliance: np.ndarray  #: Q, m/N, shape (m, k, k)
    gap: np.ndarray  #: g, m, shape (m, k)

    def carried_by(self, pairs):
        """Return (a, b) of a set of pairs that touch, shape (m, p): their forces are a x - b."""
        inverse = np.linalg.inv(self.compliance[:, pairs][:, :, pairs])
        return inverse.sum(-1), (inverse @ self.gap[:, pairs, None])[..., 0]

    def share(self, loads):
        """Return the `Sharing` under loads >= 0 in N, shape (l,)."""
        loads = np.asarray(loads, float)[:, None]
        m, k = self.gap.shape
        shape = (loads.size, m)
        error, stiffness, force = np.zeros(shape), np.zeros(shape), np.zeros((*shape, k))
        touching, worst = np.zeros((*shape, k), bool), np.full(shape, math.inf)
        own = np.einsum("mii->mi", self.compliance)
        for size in range(1, k + 1):
            for pairs in map(list, itertools.combinations(range(k), size)):
                rise, back = self.carried_by(pairs)
                x = (loads + back.sum(-1)) / rise.sum(-1)
                forces = np.zeros((*shape, k))
                forces[..., pairs] = rise * x[..., None] - back
                # By how much a pair that touches would have to pull, one that does not overlaps.
                wrong = x[..., None] - self.gap - _image(self.compliance, forces)
                wrong[..., pairs] = -(own * forces)[..., pairs]
                most = np.where(self.inside, wrong, -math.inf).max(-1)
                better = (most < worst) & self.inside[:, pairs].all(-1)
                worst = np.where(better, most, worst)
                error, stiffness = (
                    np.where(better, new, old)
                    for new, old in ((x, error), (rise.sum(-1), stiffness))
                )
                force[better] = forces[better]
                touching[better] = np.isin(np.arange(k), pairs)
        return Sharing(error, np.maximum(force, 0.0), touching, stiffness)

    def overlap(self, sharing):
        """Return by how much the flanks of a pair overlap beside the others, m, shape (l, m, k).

        Of a pair that touches it is > 0, of others the negative distance of their flanks.
        """
        own = np.einsum("mii->mi", self.compliance)
        overlap = sharing.error[..., None] - self.gap - _image(self.compliance, sharing.force)
        overlap = overlap + own * sharing.force
        # Without load pairs touch that do not overlap: the sign tells.
        least = np.finfo(float).tiny
        return np.where(sharing.touching, np.maximum(overlap, least), np.minimum(overlap, -least))


def _image(compliance, forces):
    return (compliance @ forces[..., None])[..., 0]


def tooth_pairs(mesh, phases, *, pitch_errors=None, **options):
    """Return the `ToothPairs` at equal phases; arguments as of `Mesh.transmission_error`."""
    phases = checks.integer("phases", phases, 8, 100_000)
    # The mesh phase is 0 in the middle of the segment with the most pairs.
    begun = (mesh.contact_ratio - math.floor(mesh.contact_ratio)) / 2.0
    pitch_errors = checked_errors(mesh, pitch_errors)
    pitches = begun + np.arange(pitch_errors.size * phases) / phases
    return pairs_at(mesh, pitches, np.floor(pitches), pitch_errors=pitch_errors, **options)


def pairs_at(
    mesh,
    pitches,
    begun,
    inside=None,
    *,
    stiffness="energy",
    coupling=1.0,
    deviation=None,
    pitch_errors=None,
):
    """Return the `ToothPairs` of a spur mesh; options as of `Mesh.transmission_error`.

    `pitches`, shape (m,), are base pitches since the first pair came into mesh, `begun` how
    many of them count as whole: the number of the last pair. `inside` as of `ToothPairs`, shape
    (m, k), where it is to be decided elsewhere.
    """
    if mesh.overlap_ratio > 0.0:
        raise ValueError(
            f"helix_angle = {mesh.pinion.helix_angle!r} is not allowed: it must be 0, load sharing "
            "along the path of contact is that of spur gears"
        )
    if deviation is not None and not isinstance(deviation, PathTable):
        raise ValueError(f"deviation = {deviation!r} is not allowed: it must be a PathTable")
    slots = np.arange(math.floor(mesh.contact_ratio) + 1)
    since = (pitches - begun)[:, None] + slots
    if inside is None:
        inside = since < mesh.contact_ratio
    position = mesh.path[0] + np.minimum(since, mesh.contact_ratio) * mesh.base_pitch
    # Compliances repeat with every pitch; only errors tell the pairs of a long run-out apart.
    place = np.column_stack([np.round(since[:, 0] / _SAME_PLACE), inside])
    _, first, each = np.unique(place, axis=0, return_index=True, return_inverse=True)
    own = _compliance(mesh, position[first], inside[first], stiffness, coupling)
    compliance = own[each.reshape(-1)]
    gap = relief_gap(mesh, position)
    if deviation is not None:
        gap = gap + deviation.at(position)
    errors = checked_errors(mesh, pitch_errors)
    number = begun.astype(int)[:, None] - slots
    return ToothPairs(pitches, position, inside, compliance, gap + errors[number % errors.size])


def checked_errors(mesh, values=None):
    """Return pitch errors, by default those of the gears, as an array, shape (n,), n > 0."""
    if values is None:
        return np.array(mesh.pitch_errors)
    if np.ndim(values) != 1 or not np.size(values):
        raise checks.refusal("pitch_errors", values, "a sequence of at least one number")
    return np.array(checks.finite("pitch_errors", values))


def relief_gap(mesh, position):
    """Return the gap that the tip reliefs of both gears leave at positions of the path, m."""
    start, end = mesh.path
    gap = np.zeros(np.shape(position))
    for gear, from_tip in ((mesh.pinion, end - position), (mesh.wheel, position - start)):
        if gear.tip_relief is not None:
            gap = gap + gear.tip_relief.gap(from_tip)
    return gap


def _compliance(mesh, position, inside, stiffness, coupling):
    coupling = checks.number("coupling", coupling, "from 0 to 1", lambda v: 0.0 <= v <= 1.0)
    identity = np.eye(position.shape[1])
    if isinstance(stiffness, PathTable):
        values = stiffness.at(position)
        if not values.min() > 0.0:
            raise ValueError(
                f"stiffness = {values.min():.6g} N/m is not allowed: it must be > 0 all along the "
                "path of contact"
            )
        return identity / values[..., None]
    if stiffness == "energy":
        return matrix(PairCompliance(mesh), position, np.ones(position.shape), coupling)
    checks.require(stiffness == "iso", "stiffness", stiffness, "'iso', 'energy' or a PathTable")
    # n pairs in mesh are (0.25 + 0.75 n) c' together if they share a body of 1 / (1 + 3 n) c'.
    single = 1.0 / (iso_stiffness(mesh).single * 1e9 * mesh.width)
    body = (single * coupling / (1.0 + 3.0 * inside.sum(-1)))[:, None, None]
    return (single - body) * identity + body

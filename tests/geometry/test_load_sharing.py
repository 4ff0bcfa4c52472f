"""Load sharing and static transmission error: closed forms, other solvers, limits."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq, nnls

from gearlib.geometry import GearStage, PathTable, Rack, SpurGear, TipRelief, optimum_relief
from gearlib.models.geometry.load_sharing import ToothPairs
from gearlib.models.geometry.mesh_stiffness import energy_stiffness
from tests.geometry.stages import fzg_c, gears_of_20_teeth, iso_example, ring

MESHES = pytest.mark.parametrize("mesh", [fzg_c(), gears_of_20_teeth(), ring()])
PAIR_STIFFNESS = 2e8  #: N/m, of a pair of teeth where it is constant
CONSTANT = PathTable((0.0,), (PAIR_STIFFNESS,))
TORQUE = 300.0


@MESHES
def test_transmission_error_without_relief_is_load_over_stiffness(mesh):
    """With the rectangle of ISO 6336-1, and with the stiffness of the energy method."""
    segment = mesh.contact_ratio - 1.0
    iso = mesh.transmission_error([TORQUE, 2.0 * TORQUE], stiffness="iso")
    found = mesh.stiffness("iso")
    from_middle = np.abs(np.mod(iso.phase + math.pi, math.tau) - math.pi)
    double = from_middle < math.pi * segment
    expected = found.max_stiffness * np.where(double, 1.0, found.stiffness_ratio)
    # Rounding only.
    np.testing.assert_allclose(iso.mesh_stiffness, np.tile(expected, (2, 1)), rtol=1e-12)
    np.testing.assert_allclose(
        iso.transmission_error, iso.mesh_force.values[:, None] / expected, rtol=1e-12
    )
    np.testing.assert_allclose(iso.effective_contact_ratio, mesh.contact_ratio, rtol=1e-12)
    energy = mesh.transmission_error(TORQUE)
    pitches = np.mod(energy.phase / math.tau + segment / 2.0, 1.0).values
    for count in (1, 2):
        chosen = energy.pairs_in_contact.values[0] == count
        stiffness = energy_stiffness(mesh, pitches[chosen], count)
        np.testing.assert_allclose(energy.mesh_stiffness.values[0, chosen], stiffness, rtol=1e-12)
    np.testing.assert_allclose(energy.load_share.sum("tooth_pair"), 1.0, rtol=1e-12)


@MESHES
def test_long_linear_relief_by_the_deflection_of_a_pair_flattens_exactly(mesh):
    """After Harris: with pairs of a constant stiffness c, and with the rectangle of ISO 6336-1.

    At a load F and the design load F_d the error is |F - F_d| / (2 c) from peak to peak; below F_d
    only F / F_d of double contact is left.
    """
    design = mesh.load(TORQUE)
    relieved = optimum_relief(mesh, TORQUE, stiffness=CONSTANT)
    for gear in (relieved.pinion, relieved.wheel):
        assert gear.tip_relief.amount == pytest.approx(design / PAIR_STIFFNESS, rel=1e-12)
    torques = TORQUE * np.array([0.25, 0.5, 1.0, 2.0, 5.0])
    found = relieved.transmission_error(torques, phases=512, stiffness=CONSTANT)
    loads = found.mesh_force.values
    # Extrema lie in single contact and in the middle of double contact, at phases of the grid.
    np.testing.assert_allclose(
        found.peak_to_peak_error,
        np.abs(loads - design) / (2.0 * PAIR_STIFFNESS),
        atol=1e-12 * design / PAIR_STIFFNESS,
    )
    extra = (mesh.contact_ratio - 1.0) * np.minimum(loads / design, 1.0)
    # Where a pair comes to touch is found within a phase of the grid, at both ends of its way.
    np.testing.assert_allclose(found.effective_contact_ratio, 1.0 + extra, atol=2.0 / 512)
    iso = optimum_relief(mesh, TORQUE, stiffness="iso")
    flat = iso.transmission_error(TORQUE, stiffness="iso")
    assert flat.peak_to_peak_error < 1e-12 * flat.transmission_error.max()
    # Two pairs have the stiffness 1.75 c', a pair alone c': 1/7 of its compliance is the body that
    # both share, 6/7 are its own.
    single = mesh.stiffness("iso").max_stiffness / 1.75
    assert iso.pinion.tip_relief.amount == pytest.approx(6.0 / 7.0 * design / single, rel=1e-12)


@pytest.mark.parametrize(("length", "spans"), [("short", [0.5]), (None, [0.4, 0.7, 1.0])])
def test_no_relief_of_a_grid_is_better_than_the_optimum(length, spans):
    mesh, amounts = fzg_c(), (0.5e-5, 1e-5, 1.5e-5, 2.5e-5)
    found = optimum_relief(mesh, TORQUE, length=length, phases=64)
    least = found.transmission_error(TORQUE, phases=64).peak_to_peak_error.item()
    for span, *pair in itertools.product(spans, amounts, amounts):
        reliefs = [TipRelief(amount=amount, length=span * mesh.longest_relief) for amount in pair]
        other = mesh.with_reliefs(*reliefs).transmission_error(TORQUE, phases=64)
        assert least <= other.peak_to_peak_error.item() * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("teeth", "module", "width", "torque", "shape", "least"),
    # The least errors in um of 23 000 reliefs in a grid and of descents from the best of them, for
    # pairs of teeth that have the whole bodies in common.
    [
        ((24, 24), 4e-3, 0.02, 200.0, "parabolic", 0.6308),
        ((25, 60), 3e-3, 0.02, 120.0, "parabolic", 0.4114),
        ((31, 47), 2e-3, 0.015, 60.0, "linear", 0.2336),
        ((23, -77), 2.5e-3, 0.025, 90.0, "linear", 0.1961),
        ((40, 60), 3e-3, 0.02, 200.0, "parabolic", 0.2813),
    ],
)
def test_optimum_relief_is_better_than_its_neighbours(teeth, module, width, torque, shape, least):
    rack = Rack(addendum=1.3, dedendum=1.55, tip_radius=0.1) if teeth[0] == 40 else "A"
    common = {"module": module, "width": width, "rack": rack}
    mesh = GearStage(*(SpurGear(teeth=abs(z), internal=z < 0, **common) for z in teeth))
    relieved = optimum_relief(mesh, torque, shape=shape, coupling=1.0)
    found = relieved.transmission_error(torque, coupling=1.0)
    assert found.peak_to_peak_error.item() <= 1.02e-6 * least


def test_unloaded_transmission_error_is_the_least_gap():
    relief = TipRelief(amount=2e-5, length=fzg_c().longest_relief, shape="parabolic")
    mesh = fzg_c().with_reliefs(relief, None)
    found = mesh.transmission_error(0.0, deviation=PathTable((0.0,), (3e-6,)))
    np.testing.assert_allclose(found.transmission_error[0], found.gap.min("tooth_pair"), atol=1e-20)
    assert np.isnan(found.load_share).all() and (found.pairs_in_contact >= 1).all()
    # One pair follows the other: within a phase of the grid at either end.
    assert found.effective_contact_ratio.item() == pytest.approx(1.0, abs=2.0 / 256)


def random_pairs(count, coupled):
    """Return `ToothPairs` at 40 phases, with random compliances and gaps."""
    rng = np.random.default_rng(count)
    compliance = rng.uniform(0.5, 2.0, (40, count))[..., None] * np.eye(count)
    if coupled:
        root = rng.uniform(0.2, 0.7, (40, count))
        compliance = compliance + root[:, :, None] * root[:, None, :]
    inside = rng.uniform(size=(40, count)) < 0.8
    inside[:, 0] = True
    gap = rng.uniform(-1.0, 3.0, (40, count))
    position, smallest_gap = np.zeros((40, count)), np.where(inside, gap, np.inf).min(1)
    return ToothPairs(np.zeros(40), position, inside, compliance, gap, smallest_gap)


@pytest.mark.parametrize(("count", "coupled"), [(2, True), (3, False), (4, True)])
def test_equilibrium_matches_root_finding_by_scipy(count, coupled):
    """Forces at a displacement by non-negative least squares, the displacement by Brent."""
    pairs, loads = random_pairs(count, coupled), [0.1, 1.0, 4.0]
    found = pairs.forces_under_loads(loads)
    for (i, load), m in itertools.product(enumerate(loads), range(40)):
        there = pairs.can_touch[m]
        root = np.linalg.cholesky(pairs.compliance[m][np.ix_(there, there)])
        gap = pairs.gap[m, there]

        def forces(x, root=root, gap=gap):
            return nnls(root.T, np.linalg.solve(root, x - gap))[0]

        def missing(x, forces=forces, load=load):
            return forces(x).sum() - load

        x = brentq(missing, gap.min(), gap.max() + 50.0, xtol=1e-13)
        # Brent's tolerance and some conditioning.
        assert found.displacement[i, m] == pytest.approx(x, abs=1e-11)
        np.testing.assert_allclose(found.force[i, m, there], forces(x), atol=1e-10)
        assert not found.force[i, m, ~there].any()


@MESHES
def test_relief_of_a_gear_begins_at_its_own_tip(mesh):
    """The pinion's lies at the end of the path, the wheel's at its beginning, as in a table."""
    (start, end), length = mesh.path, mesh.longest_relief
    wheel, pinion = (TipRelief(amount=amount, length=length) for amount in (2e-5, 1e-5))
    table = PathTable((start, start + length, end - length, end), (2e-5, 0.0, 0.0, 1e-5))
    modified = mesh.with_reliefs(pinion, wheel).transmission_error(TORQUE)
    by_table = mesh.transmission_error(TORQUE, deviation=table)
    np.testing.assert_allclose(modified.gap, table.at(modified.path_position), atol=1e-18)
    np.testing.assert_allclose(modified.transmission_error, by_table.transmission_error, rtol=1e-12)
    parabola = TipRelief(amount=2e-5, length=length, shape="parabolic")
    np.testing.assert_allclose(parabola.gap([0.0, length / 2, length]), [2e-5, 5e-6, 0.0])


def test_pitch_errors_of_both_gears_add_up_in_each_pair():
    """Teeth meet again after the least common multiple of 16 and 24 mesh periods."""
    mesh, rng = fzg_c(), np.random.default_rng(0)
    pinion, wheel = (tuple(rng.uniform(0.0, 5e-6, z)) for z in (16, 24))
    modified = dataclasses.replace(
        mesh,
        pinion=dataclasses.replace(mesh.pinion, pitch_errors=pinion),
        wheel=dataclasses.replace(mesh.wheel, pitch_errors=wheel),
    )
    found = modified.transmission_error(TORQUE, phases=8, stiffness=CONSTANT)
    errors, deflection = np.tile(pinion, 3) + np.tile(wheel, 2), mesh.load(TORQUE) / PAIR_STIFFNESS
    single, both = found.transmission_error[0].values.reshape(48, 8)[:, [4, 0]].T
    np.testing.assert_allclose(single, deflection + errors, rtol=1e-12)
    # In double contact a pair shares with the one before it.
    mean = (errors + np.roll(errors, 1)) / 2.0
    np.testing.assert_allclose(both, deflection / 2.0 + mean, rtol=1e-12)
    assert dataclasses.replace(modified, wheel=mesh.wheel).pitch_errors == pinion


@pytest.mark.parametrize("load_ratio", [0.0, 0.2, 1.0])
def test_helical_gears_match_a_stack_of_spur_slices(load_ratio):
    """The forces c (x - g) of 4000 separate slices add up to the load; relief as in a table."""
    bare, torque = iso_example(), 9000.0 * load_ratio
    (start, end), length = bare.path, bare.longest_relief
    wheel, pinion = (TipRelief(amount=amount, length=length) for amount in (6e-5, 3e-5))
    table = PathTable((start, start + length, end - length, end), (6e-5, 0.0, 0.0, 3e-5))
    mesh = bare.with_reliefs(pinion, wheel)
    found = mesh.transmission_error(torque, phases=256, stiffness=CONSTANT)
    delays = mesh.overlap_ratio * ((np.arange(4000) + 0.5) / 4000 - 0.5)
    first = (mesh.contact_ratio % 1.0) / 2.0
    for phase in range(0, 256, 16):
        position = start + mesh.base_pitch * (first + phase / 256 + delays + np.c_[-4:5])
        position = position[(position >= start) & (position < end)]
        gap = table.at(position)

        def missing(x, gap=gap):
            return PAIR_STIFFNESS * np.maximum(x - gap, 0.0).sum() / 4000 - mesh.load(torque)

        x = brentq(missing, -1e-6, 2e-3, xtol=1e-15) if torque else gap.min()
        # The length of contact of a pair is a whole number of slices, 256 in a base pitch.
        assert found.transmission_error[0, phase].item() == pytest.approx(x, rel=3e-3, abs=1e-10)


def test_a_tiny_helix_angle_gives_the_spur_gear_results():
    """Spur gears are the limit of helical ones, with relief and pitch errors."""
    relief = TipRelief(amount=2e-5, length=2e-3)
    spur, helical = (
        gears_of_20_teeth(helix_angle=angle, tip_relief=relief) for angle in (0.0, 1e-8)
    )
    errors = (0.0, 3e-6, -2e-6)
    spur, helical = (
        mesh.transmission_error([0.0, 500.0], phases=63, pitch_errors=errors)
        for mesh in (spur, helical)
    )
    for name in ("transmission_error", "peak_to_peak_error"):
        np.testing.assert_allclose(helical[name], spur[name], atol=1e-13)


def test_optimum_relief_of_helical_gears_is_better_than_others():
    mesh, torque = iso_example(), 9000.0
    least = optimum_relief(mesh, torque).transmission_error(torque).peak_to_peak_error.item()
    for span, amount in itertools.product((0.5, 0.8, 1.0), (0.0, 2e-5, 4e-5, 6e-5, 8e-5)):
        relief = TipRelief(amount=amount, length=span * mesh.longest_relief)
        other = mesh.with_reliefs(relief, relief).transmission_error(torque)
        assert least < other.peak_to_peak_error.item()
    assert least < 0.15 * mesh.transmission_error(torque).peak_to_peak_error.item()
    with pytest.raises(ValueError, match=r"^phases = 800 is not allowed: it must be at most 744, "):
        mesh.transmission_error(torque, phases=800)

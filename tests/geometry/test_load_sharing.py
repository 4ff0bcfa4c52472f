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
from tests.geometry.stages import fzg_c, gears_of_20_teeth, iso_example, ring_stage

EACH_STAGE = pytest.mark.parametrize("mesh", [fzg_c(), gears_of_20_teeth(), ring_stage()])
PAIR_STIFFNESS = 2e8  #: N/m, of a pair of teeth where it is constant
CONSTANT_STIFFNESS = PathTable((0.0,), (PAIR_STIFFNESS,))
TORQUE = 300.0


@EACH_STAGE
def test_transmission_error_without_relief_is_load_over_stiffness(mesh):
    """Check load / stiffness for the rectangle of ISO 6336-1 and for the energy method."""
    double_contact_length = mesh.contact_ratio - 1.0
    iso = mesh.transmission_error([TORQUE, 2.0 * TORQUE], stiffness="iso")
    stiffness_of_stage = mesh.stiffness("iso")
    from_middle = np.abs(np.mod(iso.phase + math.pi, math.tau) - math.pi)
    is_double_contact = from_middle < math.pi * double_contact_length
    expected = stiffness_of_stage.max_stiffness * np.where(
        is_double_contact, 1.0, stiffness_of_stage.stiffness_ratio
    )
    # The tolerances allow for rounding only.
    np.testing.assert_allclose(iso.mesh_stiffness, np.tile(expected, (2, 1)), rtol=1e-12)
    np.testing.assert_allclose(
        iso.transmission_error, iso.mesh_force.values[:, None] / expected, rtol=1e-12
    )
    np.testing.assert_allclose(iso.effective_contact_ratio, mesh.contact_ratio, rtol=1e-12)
    energy = mesh.transmission_error(TORQUE)
    pitches = np.mod(energy.phase / math.tau + double_contact_length / 2.0, 1.0).values
    for count in (1, 2):
        is_selected = energy.pairs_in_contact.values[0] == count
        stiffness = energy_stiffness(mesh, pitches[is_selected], count)
        np.testing.assert_allclose(
            energy.mesh_stiffness.values[0, is_selected], stiffness, rtol=1e-12
        )
    np.testing.assert_allclose(energy.load_share.sum("tooth_pair"), 1.0, rtol=1e-12)


@EACH_STAGE
def test_long_linear_relief_by_the_deflection_of_a_pair_flattens_exactly(mesh):
    """Harris's relief makes the transmission error constant at the design load F_d.

    For tooth pairs of constant stiffness c the peak-to-peak error at a load F is |F - F_d| / (2 c),
    and below F_d only the fraction F / F_d of double contact is left.
    """
    design = mesh.load(TORQUE)
    relieved = optimum_relief(mesh, TORQUE, stiffness=CONSTANT_STIFFNESS)
    for gear in (relieved.pinion, relieved.wheel):
        assert gear.tip_relief.amount == pytest.approx(design / PAIR_STIFFNESS, rel=1e-12)
    torques = TORQUE * np.array([0.25, 0.5, 1.0, 2.0, 5.0])
    error = relieved.transmission_error(torques, phases=512, stiffness=CONSTANT_STIFFNESS)
    loads = error.mesh_force.values
    # Extrema lie in single contact and in the middle of double contact, at phases of the grid.
    np.testing.assert_allclose(
        error.peak_to_peak_error,
        np.abs(loads - design) / (2.0 * PAIR_STIFFNESS),
        atol=1e-12 * design / PAIR_STIFFNESS,
    )
    double_contact_fraction = (mesh.contact_ratio - 1.0) * np.minimum(loads / design, 1.0)
    # Both ends of the contact of a pair are known to one phase of the grid.
    np.testing.assert_allclose(
        error.effective_contact_ratio, 1.0 + double_contact_fraction, atol=2.0 / 512
    )
    iso = optimum_relief(mesh, TORQUE, stiffness="iso")
    flat = iso.transmission_error(TORQUE, stiffness="iso")
    assert flat.peak_to_peak_error < 1e-12 * flat.transmission_error.max()
    # By ISO 6336 two pairs have the stiffness 1.75 c' and a single one c'. Therefore 1/7 of the
    # compliance of a pair belongs to the shared body and 6/7 to the pair alone.
    single = mesh.stiffness("iso").max_stiffness / 1.75
    assert iso.pinion.tip_relief.amount == pytest.approx(6.0 / 7.0 * design / single, rel=1e-12)


@pytest.mark.parametrize(("length", "spans"), [("short", [0.5]), (None, [0.4, 0.7, 1.0])])
def test_no_relief_of_a_grid_is_better_than_the_optimum(length, spans):
    """The optimum relief must give the least transmission error of all reliefs of a grid."""
    mesh, amounts = fzg_c(), (0.5e-5, 1e-5, 1.5e-5, 2.5e-5)
    optimum = optimum_relief(mesh, TORQUE, length=length, phases=64)
    smallest_error = optimum.transmission_error(TORQUE, phases=64).peak_to_peak_error.item()
    for span, *pair in itertools.product(spans, amounts, amounts):
        reliefs = [TipRelief(amount=amount, length=span * mesh.longest_relief) for amount in pair]
        error = mesh.with_reliefs(*reliefs).transmission_error(TORQUE, phases=64)
        assert smallest_error <= error.peak_to_peak_error.item() * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("teeth", "module", "width", "torque", "shape", "least"),
    # The last column is the least error, um, of 23 000 reliefs in a grid and of descents from the
    # best of them. Tooth pairs share the whole bodies.
    [
        ((24, 24), 4e-3, 0.02, 200.0, "parabolic", 0.6308),
        ((25, 60), 3e-3, 0.02, 120.0, "parabolic", 0.4114),
        ((31, 47), 2e-3, 0.015, 60.0, "linear", 0.2336),
        ((23, -77), 2.5e-3, 0.025, 90.0, "linear", 0.1961),
        ((40, 60), 3e-3, 0.02, 200.0, "parabolic", 0.2813),
    ],
)
def test_optimum_relief_matches_the_best_of_a_fine_grid(teeth, module, width, torque, shape, least):
    """The optimum must be within 2 % of `least`, the best error (um) of a fine grid."""
    rack = Rack(addendum=1.3, dedendum=1.55, tip_radius=0.1) if teeth[0] == 40 else "A"
    common = {"module": module, "width": width, "rack": rack}
    mesh = GearStage(*(SpurGear(teeth=abs(z), internal=z < 0, **common) for z in teeth))
    relieved = optimum_relief(mesh, torque, shape=shape, coupling=1.0)
    error = relieved.transmission_error(torque, coupling=1.0)
    assert error.peak_to_peak_error.item() <= 1.02e-6 * least


def test_unloaded_transmission_error_is_the_least_gap():
    """Without load the gears must touch where the gap between the flanks is least."""
    relief = TipRelief(amount=2e-5, length=fzg_c().longest_relief, shape="parabolic")
    mesh = fzg_c().with_reliefs(relief, None)
    error = mesh.transmission_error(0.0, deviation=PathTable((0.0,), (3e-6,)))
    np.testing.assert_allclose(error.transmission_error[0], error.gap.min("tooth_pair"), atol=1e-20)
    assert np.isnan(error.load_share).all() and (error.pairs_in_contact >= 1).all()
    # A single pair is in contact at a time, with ends known to one phase of the grid.
    assert error.effective_contact_ratio.item() == pytest.approx(1.0, abs=2.0 / 256)


def random_pairs(count, coupled):
    """Return `ToothPairs` at 40 phases, with random compliances and gaps of `count` pairs.

    If `coupled`, loads on one pair also deflect the others.
    """
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
    """Solve for forces by non-negative least squares and for the displacement by Brent's method."""
    pairs, loads = random_pairs(count, coupled), [0.1, 1.0, 4.0]
    equilibrium = pairs.solve_for_loads(loads)
    for (load_index, load), phase_index in itertools.product(enumerate(loads), range(40)):
        in_reach = pairs.can_touch[phase_index]
        root = np.linalg.cholesky(pairs.compliance[phase_index][np.ix_(in_reach, in_reach)])
        gap = pairs.gap[phase_index, in_reach]

        def forces(x, root=root, gap=gap):
            """Return the non-negative forces of the pairs at the displacement `x`."""
            return nnls(root.T, np.linalg.solve(root, x - gap))[0]

        def force_surplus(x, forces=forces, load=load):
            """Return the sum of the forces minus the load."""
            return forces(x).sum() - load

        x = brentq(force_surplus, gap.min(), gap.max() + 50.0, xtol=1e-13)
        # The bound allows for the tolerance of Brent's method and for conditioning.
        assert equilibrium.displacement[load_index, phase_index] == pytest.approx(x, abs=1e-11)
        np.testing.assert_allclose(
            equilibrium.force[load_index, phase_index, in_reach], forces(x), atol=1e-10
        )
        assert not equilibrium.force[load_index, phase_index, ~in_reach].any()


@EACH_STAGE
def test_relief_of_a_gear_begins_at_its_own_tip(mesh):
    """Compare with a table: pinion relief is at the end of the path, wheel relief at its start."""
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
    """The same teeth meet after 48 mesh periods; single and double contact have closed forms."""
    mesh, rng = fzg_c(), np.random.default_rng(0)
    pinion, wheel = (tuple(rng.uniform(0.0, 5e-6, z)) for z in (16, 24))
    modified = dataclasses.replace(
        mesh,
        pinion=dataclasses.replace(mesh.pinion, pitch_errors=pinion),
        wheel=dataclasses.replace(mesh.wheel, pitch_errors=wheel),
    )
    error = modified.transmission_error(TORQUE, phases=8, stiffness=CONSTANT_STIFFNESS)
    errors, deflection = np.tile(pinion, 3) + np.tile(wheel, 2), mesh.load(TORQUE) / PAIR_STIFFNESS
    single, double = error.transmission_error[0].values.reshape(48, 8)[:, [4, 0]].T
    np.testing.assert_allclose(single, deflection + errors, rtol=1e-12)
    # In double contact a pair shares the load with the preceding one.
    mean = (errors + np.roll(errors, 1)) / 2.0
    np.testing.assert_allclose(double, deflection / 2.0 + mean, rtol=1e-12)
    assert dataclasses.replace(modified, wheel=mesh.wheel).pitch_errors == pinion


@pytest.mark.parametrize("load_ratio", [0.0, 0.2, 1.0])
def test_helical_gears_match_a_stack_of_spur_slices(load_ratio):
    """The forces c (x - g) of 4000 separate slices of relieved teeth must add up to the load."""
    unrelieved, torque = iso_example(), 9000.0 * load_ratio
    (start, end), length = unrelieved.path, unrelieved.longest_relief
    wheel, pinion = (TipRelief(amount=amount, length=length) for amount in (6e-5, 3e-5))
    table = PathTable((start, start + length, end - length, end), (6e-5, 0.0, 0.0, 3e-5))
    mesh = unrelieved.with_reliefs(pinion, wheel)
    error = mesh.transmission_error(torque, phases=256, stiffness=CONSTANT_STIFFNESS)
    delays = mesh.overlap_ratio * ((np.arange(4000) + 0.5) / 4000 - 0.5)
    reference_phase = (mesh.contact_ratio % 1.0) / 2.0
    for phase in range(0, 256, 16):
        position = start + mesh.base_pitch * (reference_phase + phase / 256 + delays + np.c_[-4:5])
        position = position[(position >= start) & (position < end)]
        gap = table.at(position)

        def force_surplus(x, gap=gap):
            """Return the sum of the forces at the displacement `x` minus the load."""
            return PAIR_STIFFNESS * np.maximum(x - gap, 0.0).sum() / 4000 - mesh.load(torque)

        x = brentq(force_surplus, -1e-6, 2e-3, xtol=1e-15) if torque else gap.min()
        # The length of contact of a pair is a whole number of slices, 256 in a base pitch.
        assert error.transmission_error[0, phase].item() == pytest.approx(x, rel=3e-3, abs=1e-10)


def test_a_tiny_helix_angle_gives_the_spur_gear_results():
    """Spur gears are the limit of helical ones, also with relief and pitch errors."""
    relief = TipRelief(amount=2e-5, length=2e-3)
    settings = {"phases": 63, "pitch_errors": (0.0, 3e-6, -2e-6)}
    spur_gears = gears_of_20_teeth(helix_angle=0.0, tip_relief=relief)
    helical_gears = gears_of_20_teeth(helix_angle=1e-8, tip_relief=relief)
    spur = spur_gears.transmission_error([0.0, 500.0], **settings)
    helical = helical_gears.transmission_error([0.0, 500.0], **settings)
    for name in ("transmission_error", "peak_to_peak_error"):
        np.testing.assert_allclose(helical[name], spur[name], atol=1e-13)


def test_optimum_relief_of_helical_gears_is_better_than_a_grid_of_reliefs():
    """The optimum relief must give a smaller transmission error than every relief of a grid."""
    mesh, torque = iso_example(), 9000.0
    smallest_error = (
        optimum_relief(mesh, torque).transmission_error(torque).peak_to_peak_error.item()
    )
    for span, amount in itertools.product((0.5, 0.8, 1.0), (0.0, 2e-5, 4e-5, 6e-5, 8e-5)):
        relief = TipRelief(amount=amount, length=span * mesh.longest_relief)
        error = mesh.with_reliefs(relief, relief).transmission_error(torque)
        assert smallest_error < error.peak_to_peak_error.item()
    assert smallest_error < 0.15 * mesh.transmission_error(torque).peak_to_peak_error.item()
    with pytest.raises(ValueError, match=r"^phases = 800 is not allowed: it must be at most 744, "):
        mesh.transmission_error(torque, phases=800)

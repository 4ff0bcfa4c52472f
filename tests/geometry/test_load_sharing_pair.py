"""Dynamic load sharing of tooth pairs: closed forms, scipy from event to event, limits."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import KroghInterpolator
from scipy.optimize import nnls

from gearlib import GearPair, LoadSharingPair, duty_point, simulate
from gearlib.data.status import JAMMED
from gearlib.geometry import GearStage, PathTable, SpurGear, TipRelief, optimum_relief
from gearlib.models.geometry import load_sharing
from gearlib.models.geometry.load_sharing import corner_gap, tooth_pairs, tooth_pairs_at
from tests.geometry.stages import (
    fzg_c,
    gears_of_20_teeth,
    high_contact_ratio_stage,
    ring_stage,
    short_tooth_stage,
)

TORQUE = 300.0
OPTIONS = {"torque": TORQUE, "damping_ratio": 0.05, "backlash_damping_ratio": 0.01}
#: Closed forms exist for the nominal path of contact only.
WITHOUT_CORNER_CONTACT = {"corner_contact": False}
#: Backlash, m, too large for contact of the coast sides.
LARGE_BACKLASH = 5e-3


@pytest.mark.parametrize(
    "mesh",
    [
        fzg_c(),
        replace(gears_of_20_teeth(), backlash=2e-6),
        high_contact_ratio_stage(),
        ring_stage(),
    ],
)
def test_without_relief_the_load_sharing_pair_matches_the_rectangular_pair(mesh):
    """Without relief the stiffness after ISO 6336 is the rectangle of `GearPair`."""
    model = LoadSharingPair.from_geometry(
        mesh, stiffness="iso", **WITHOUT_CORNER_CONTACT, **OPTIONS
    )
    settings = {"periods": 60, "record_periods": 2, "samples_per_period": 64}
    teeth_run, pair_run = simulate(model, 0.9, **settings), simulate(model.pair, 0.9, **settings)
    assert pair_run.bounces > 0.0 or pair_run.displacement_min > 0.0
    # Samples at a switch of the stiffness may lie on either side of it, two at most.
    for name in ("displacement", "velocity"):
        np.testing.assert_allclose(teeth_run[name], pair_run[name], atol=1e-11)
    for name in ("acceleration", "dynamic_force", "modified_stiffness"):
        is_different = (
            np.abs(teeth_run[name] - pair_run[name]) > 1e-9 * np.abs(pair_run[name]).max()
        )
        assert int(is_different.sum()) <= 2, name
    names = ["dynamic_force_max", "displacement_min", "fraction_drive", "bounces"]
    for name in names + ["fraction_coast"] * (mesh.backlash < 1e-5):
        assert teeth_run[name].item() == pytest.approx(pair_run[name].item(), abs=1e-11), name


@pytest.mark.parametrize("corners", [False, True])
def test_tooth_pairs_coupled_by_the_body_move_as_integrated_by_scipy(corners):
    """Integrate by scipy from entry to entry of a pair; least squares give the forces."""
    torque = TORQUE / (8.0 if corners else 2.0)
    mesh = optimum_relief(
        replace(fzg_c(), backlash=LARGE_BACKLASH), torque, length="long", stiffness="iso"
    )
    stage_options = {"stiffness": "iso", "phases": 8, "corner_contact": corners}
    model = LoadSharingPair.from_geometry(mesh, **stage_options, **OPTIONS)
    tuning, starts = 0.8, model.system_and_max_stiffness[0].starts
    shift = (mesh.contact_ratio - 1.0) / 2.0

    def pairs(tau, middle):
        """Return the tooth pairs at the phase `tau`, those in reach at the phase `middle`."""
        pitches = np.array([tau, middle]) / math.tau + shift
        return tooth_pairs_at(
            mesh, *pitches[:, None], stiffness="iso", corners=corners, load=model.load
        )

    # The rate is with respect to the time in which the eigenfrequency is 1.
    state = np.array([-0.5, 1.5 * tuning])
    for left, right in zip(starts, starts[1:], strict=False):
        middle = (left + right) / 2.0
        in_reach = pairs(middle, middle).can_touch[0]
        cholesky = np.linalg.cholesky(
            pairs(middle, middle).compliance[0][np.ix_(in_reach, in_reach)]
        )
        phases = left, middle, right
        gaps = [pairs(tau, middle).gap[0, in_reach] / model.static_deflection for tau in phases]
        gap_rate = (gaps[-1].min() - gaps[0].min()) / (right - left)
        parabola = KroghInterpolator(phases, gaps)

        def rates(tau, z, parabola=parabola, cholesky=cholesky, gap_rate=gap_rate):
            """Return the derivatives of displacement and rate over the phase."""
            gap = parabola(tau)
            deflection = np.linalg.solve(cholesky, z[0] - gap) * model.static_deflection
            force = nnls(cholesky.T, deflection)[0].sum() / model.load
            ratio = model.damping_ratio if force > 0.0 else model.backlash_damping_ratio
            net_force = 1.0 - force - 2.0 * ratio * (z[1] - tuning * gap_rate)
            return [z[1] / tuning, net_force / tuning]

        motion = solve_ivp(rates, (left, right), state, "DOP853", rtol=1e-9, atol=1e-10)
        state = motion.y[:, -1]
    run = simulate(model, tuning, periods=1, initial_state=(-0.5, 1.5))
    final_state, contact_loss = run.final_state.values * [1.0, tuning], run.contact_loss_fraction
    # Steps of scipy cross the events of pairs, which costs some digits.
    np.testing.assert_allclose(final_state, state, atol=1e-7)
    assert 0.0 < contact_loss.max() < 1.0


def stage_19_47(helix_angle=0.0, relief=None, width=32e-3):
    """Return a stage of 19 and 47 teeth with given helix angle, tip relief and face width."""
    common = {"module": 4e-3, "width": width, "helix_angle": helix_angle, "tip_relief": relief}
    gears = SpurGear(teeth=19, shift=0.3, **common), SpurGear(teeth=47, **common)
    return GearStage(*gears, backlash=120e-6)


@pytest.mark.parametrize("mesh", [fzg_c(), ring_stage()])
@pytest.mark.parametrize("end", [0, 1])
def test_corner_contact_opens_by_the_geometric_gap(mesh, end):
    """Turn both gears 0.04 base pitches past an end of the path, as points of the complex plane.

    At the start of the path the tip corner of the wheel approaches the flank of the pinion, at its
    end the tip corner of the pinion approaches the flank of the wheel. Gears 0
    and 1 are pinion and wheel.
    """
    sign, alpha = mesh.wheel.sign, mesh.working_pressure_angle
    radii = [gear.base_diameter / 2.0 for gear in (mesh.pinion, mesh.wheel)]
    centres, rates = (0.0, sign * mesh.centre_distance), (1.0, -sign * radii[0] / radii[1])

    def contact(position):
        """Return the point of contact at a position on the path."""
        return (radii[0] + 1j * position) * cmath.exp(-1j * alpha)

    flank_gear, tip_gear = end, 1 - end
    beyond = (2 * end - 1) * 0.04 * mesh.base_pitch
    tip_rotation = cmath.exp(1j * rates[tip_gear] * beyond / radii[0])
    corner = (contact(mesh.path[end]) - centres[tip_gear]) * tip_rotation + centres[tip_gear]
    corner -= centres[flank_gear]
    # The gap is the arc between the corner and the point of the flank at the same radius.
    roll = math.sqrt(abs(corner) ** 2 - radii[flank_gear] ** 2)
    position = sign * (mesh.wheel_roll_length(0.0) - roll) if end else roll
    flank_rotation = cmath.exp(
        1j * rates[flank_gear] * (mesh.path[end] + beyond - position) / radii[0]
    )
    angle = cmath.phase(corner / ((contact(position) - centres[flank_gear]) * flank_rotation))
    gap = float(corner_gap(mesh, np.array(mesh.path[end] + beyond)))
    assert gap == pytest.approx(abs(angle) * radii[flank_gear], rel=1e-9) and gap > 1e-7


DEVIATION = PathTable(tuple(np.linspace(*stage_19_47().path, 5)), (0.0, 0.0, 6e-6, 0.0, 0.0))
RELIEF = TipRelief(amount=15e-6, length=2e-3)
#: Stage, torque and options of each model.
STATIC_CASES = {
    "spur": (stage_19_47(), 210.0, {}),
    "relieved": (stage_19_47(relief=RELIEF), 210.0, {"stiffness": "iso"}),
    "deviating": (stage_19_47(), 210.0, {"deviation": DEVIATION, "coupling": 0.5}),
    "pitch errors": (stage_19_47(), 210.0, {"pitch_errors": (0.0, 3e-6, 1e-6)}),
    "ring gear": (ring_stage(), TORQUE, {}),
    "high contact ratio": (high_contact_ratio_stage(), TORQUE, {"stiffness": "iso"}),
    "little helix": (stage_19_47(helix_angle=0.02, relief=RELIEF), 210.0, {}),
    "helical": (stage_19_47(helix_angle=0.3), 400.0, {}),
    "short teeth": (short_tooth_stage(), TORQUE, {}),
    "wide": (stage_19_47(helix_angle=0.6, width=0.06), 210.0, {"stiffness": "iso"}),
}


@pytest.mark.parametrize("name", STATIC_CASES)
def test_slow_teeth_carry_their_static_share(name):
    """At low speed the dynamic factor is 1 and each tooth pair carries its static force."""
    mesh, torque, options = STATIC_CASES[name]
    model = LoadSharingPair.from_geometry(mesh, torque=torque, damping_ratio=0.05, **options)
    point = duty_point(model, 1.0)
    assert point.dynamic_factor == pytest.approx(1.0, abs=0.01) and point.settled == 1
    settings = {
        "periods": 3 * model.repeats,
        "record_periods": model.repeats,
        "samples_per_period": 300,
    }
    run = simulate(model, model.slowest_tuning, **settings)
    static_pairs = tooth_pairs(mesh, 300, load=model.load, corners=True, **options)
    static_forces = static_pairs.solve_for_loads([model.load]).force[0]
    np.testing.assert_allclose(static_forces.sum(-1), model.load, rtol=1e-9)
    forces = model.tooth_forces(run.phase, run.displacement)
    np.testing.assert_allclose(forces, static_forces, atol=0.01 * model.load)


@pytest.mark.parametrize("helix_angle", [0.02, 0.3])
def test_slices_across_the_face_excite_no_vibration(monkeypatch, helix_angle):
    """More slices must not change the dynamic factor where slices enter at a natural frequency."""
    errors = tuple(np.random.default_rng(1).uniform(-2e-6, 2e-6, 19))
    mesh = stage_19_47(helix_angle=helix_angle)
    mesh = replace(mesh, pinion=replace(mesh.pinion, pitch_errors=errors))

    def dynamic_factor():
        """Return the dynamic factor with the present number of slices."""
        return duty_point(mesh, 600.0, torque=210.0, damping_ratio=0.05).dynamic_factor.item()

    usual_factor = dynamic_factor()
    for name, larger_number in (
        ("MIN_SLICES", 96),
        ("MIN_INTERVALS_PER_PITCH", 96),
        ("_MAX_SLICES_AT_PHASES", 1e7),
    ):
        monkeypatch.setattr(load_sharing, name, larger_number)
    assert usual_factor == pytest.approx(dynamic_factor(), abs=2e-3)


@pytest.mark.parametrize("tuning", [0.5, 0.93])
def test_period_maps_match_difference_quotients(tuning):
    """Compare the map of two periods with central differences of final states."""
    mesh = optimum_relief(replace(fzg_c(), backlash=3e-5), TORQUE / 2.0, length="long")
    propagator = LoadSharingPair.from_geometry(mesh, **OPTIONS).propagator(tuning)
    z, step = np.array([-0.3, 0.4]), 1e-6
    _, maps, code = propagator.maps(z, 2, 1000)
    assert code == 0

    def state_after_two_periods(z):
        """Return the state after two periods."""
        return propagator.maps(z, 2, 1000)[0]

    columns = [
        (state_after_two_periods(z + d) - state_after_two_periods(z - d)) / 2.0 / step
        for d in step * np.eye(2)
    ]
    # Differences err by their step squared, and by jumps of the derivative at events.
    np.testing.assert_allclose(maps[1] @ maps[0], np.transpose(columns), atol=1e-4)


def test_static_error_of_the_pair_matches_its_stage():
    """The loaded static transmission error must exceed the unloaded one by load over stiffness."""
    mesh, sample_count = optimum_relief(fzg_c(), TORQUE / 2.0, length="long"), 65
    model = LoadSharingPair.from_geometry(mesh, **WITHOUT_CORNER_CONTACT, **OPTIONS)
    pair_at_load = model.at_load(phases=sample_count, harmonics=sample_count // 2)
    static = mesh.transmission_error([0.0, TORQUE], phases=sample_count)
    unloaded, loaded = static.transmission_error.values
    stiffness = np.interp(static.phase, pair_at_load.profile.phase, pair_at_load.profile.stiffness)
    np.testing.assert_allclose(loaded - unloaded, model.load / stiffness, rtol=1e-9)
    orders, cosines, sines = pair_at_load.deviation.table().T
    angles = np.outer(static.phase, orders)
    deviation = np.cos(angles) @ cosines + np.sin(angles) @ sines
    np.testing.assert_allclose(deviation, unloaded.mean() - unloaded, atol=1e-15)
    assert pair_at_load.load == model.load and np.ptp(unloaded) > 1e-6


@pytest.mark.parametrize(("backlash", "jams"), [(3e-6, True), (7e-6, True), (9e-6, False)])
def test_teeth_too_thick_for_the_backlash_jam(backlash, jams):
    """A tooth that is 8 um too thick jams unless the backlash is larger."""
    stage = replace(fzg_c(), backlash=backlash)
    # Each tooth pair has a constant stiffness and shares no body.
    model = LoadSharingPair(
        pair=GearPair.from_geometry(stage, **OPTIONS),
        stage=stage,
        stiffness=PathTable((0.0,), (3e8,)),
        pitch_errors=(0.0, -8e-6, 0.0),
        **WITHOUT_CORNER_CONTACT,
    )
    assert model.system(0.3).may_jam == jams
    for record in (1, 9):
        run = simulate(model, 0.3, periods=9, record_periods=record)
        assert int(run.status) == (JAMMED if jams else 0)
    # With a large backlash the thick tooth touches at -8 um, which is beyond a small backlash.
    loose_pair = replace(model, stage=fzg_c(), pair=model.pair.replace(backlash=LARGE_BACKLASH))
    run = simulate(loose_pair, 0.3, periods=9, record_periods=9)
    smallest_displacement = float(run.displacement_min) * model.static_deflection
    assert (smallest_displacement < -backlash) == jams

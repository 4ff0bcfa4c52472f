"""Compare the motion of exported FMUs with the library and scipy; check files, states, refusals.

Most tests call the binary by ctypes and need only a C compiler; some import it with FMPy.
"""

import math
import shutil
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import gearlib
from gearlib import Body, HarmonicForce, Harmonics, Mesh
from gearlib.cli.commands import main
from gearlib.models import acceleration
from tests.couple import ROSS_MATRICES, two_rotors
from tests.fmu.importer import Instance
from tests.trains import random_trains

COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")
#: Communication steps, s.
COMMUNICATION_STEPS = (1e-5, 1e-4, 1e-3, 1e-2)


def two_gears(stiffness_ratio=0.7, rigid=False, **fields):
    """Return a train of two gears with teeth 24 and 36.

    The pinion has elastic bearings unless `rigid` is true. `fields` are further fields of the mesh.
    """
    pinion_fields = {"base_radius": 0.045, "inertia": 0.005, "torque": 100.0}
    if not rigid:
        pinion_fields |= {"support_stiffness": (5e8, 5e8), "support_damping": (500.0, 500.0)}
        pinion_fields["mass"] = 3.0
    bodies = [
        Body(name="pinion", teeth=24, **pinion_fields),
        Body(name="wheel", teeth=36, base_radius=0.0675, inertia=0.02, torque=150.0),
    ]
    mesh_fields = {"backlash": 20e-6, "material_damping": 1500.0, "backlash_damping": 50.0}
    mesh_fields |= {"max_stiffness": 4e8, "stiffness_ratio": stiffness_ratio, "contact_ratio": 1.6}
    mesh_fields["deviation"] = Harmonics((2e-6,), (1e-6,))
    mesh = Mesh(pinion="pinion", wheel="wheel", **(mesh_fields | fields))
    return gearlib.GearTrain(bodies=bodies, meshes=[mesh])


#: A torque ripple at twice the mesh frequency.
RIPPLE = HarmonicForce(body="wheel", amplitude=15.0, order=2, of="pinion-wheel", phase=0.3)
#: An unbalance force, with the frequency of the pinion's rotation.
UNBALANCE = HarmonicForce(body="pinion", amplitude=60.0, order=1, of="pinion", axis="y")


def settled_state(train, tuning, periods=3000):
    """Return the state of the motion after its transient, at the start of a mesh period.

    The tuning is the mesh frequency over the natural frequency; `periods` are mesh periods.
    """
    run = gearlib.simulate(train, tuning, periods=periods, initial_state="static")
    assert int(run.status) == 0
    return tuple(run.final_state.values.tolist())


def load_fmu(folder, train, event_mode=False, **options):
    """Write the FMU of a train into a folder and return an instance of it.

    `options` are passed to `gearlib.write_fmu`.
    """
    path = folder / "train.fmu"
    gearlib.write_fmu(train, path, **options)
    return Instance(path, event_mode)


def state_in_si(train, tuning, state):
    """Convert a dimensionless state of the library to coordinates in m and rates in m/s.

    The library has coordinates in units of the static deflection, and their derivatives with
    respect to the mesh phase.
    """
    q, rates = np.split(train.start_state(state), 2)
    length = train.static_deflection
    return q * length, rates * length * train.mesh_frequency(tuning)


def mesh_displacements(train, state):
    """Return the displacements of the meshes, m, and their rates, m/s, in a single array.

    The array `state` has the coordinates, followed by their rates. Deviations are not included.
    """
    coordinates, rates = np.split(state, 2)
    jacobian = train.structure.mesh_jacobian
    return np.concatenate([jacobian @ coordinates, jacobian @ rates])


@needs_compiler
@pytest.mark.parametrize("step", COMMUNICATION_STEPS)
@pytest.mark.parametrize(
    ("train", "tuning"),
    [
        (two_gears(), 0.95),
        (two_gears(), 1.3),
        (two_gears().replace(forces=[RIPPLE, UNBALANCE]), 1.3),
    ],
)
def test_settled_motion_matches_simulate(tmp_path, train, tuning, step):
    """After 200 mesh periods the FMU must have the final state and event count of `simulate`."""
    periods, state = 200, settled_state(train, tuning)
    options = {"periods": periods, "record_periods": periods, "samples_per_period": 1}
    expected = gearlib.simulate(train, tuning, **options, initial_state=state)
    fmu = load_fmu(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    fmu.start_at(train, *state_in_si(train, tuning, state))
    fmu.run(periods * math.tau / train.mesh_frequency(tuning), step)
    final_state = np.concatenate(state_in_si(train, tuning, tuple(expected.final_state.values)))
    expected_displacements = mesh_displacements(train, final_state)
    errors = mesh_displacements(train, fmu.get_state(train)) - expected_displacements
    # Displacements and rates have different units, and so have a scale each.
    scales = np.abs(expected_displacements).reshape(2, -1).max(axis=1)
    # Rounding adds up to about 1e-12 in these periods with hundreds of events.
    assert np.abs(errors / np.repeat(scales, len(train.meshes))).max() < 1e-10
    assert fmu.get_integer("events") == expected.event.size > 100


@needs_compiler
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["random_problem", "jamming_problem", "symmetric_problem"])
def test_events_of_a_random_train_match_simulate(tmp_path, kind, seed):
    """The FMU must have the event count and final state of `simulate`, or report the same jamming.

    Friction is removed, because FMUs do not support it.
    """
    train, tuning, state = getattr(random_trains, kind)(np.random.default_rng(seed))
    train = train.replace(meshes=[replace(mesh, friction=(0.0, 0.0)) for mesh in train.meshes])
    periods = 8
    options = {"periods": periods, "record_periods": periods, "samples_per_period": 1}
    expected = gearlib.simulate(train, tuning, **options, initial_state=tuple(state))
    fmu = load_fmu(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    fmu.start_at(train, *state_in_si(train, tuning, tuple(state)))
    end = periods * math.tau / train.mesh_frequency(tuning)
    # The steps are not commensurate with the mesh periods.
    step = end / 5.3
    jams = int(expected.status) != 0
    try:
        fmu.run(end, step)
    except RuntimeError as error:
        assert jams and "both flanks" in str(error)
        return
    assert not jams
    assert fmu.get_integer("events") == expected.event.size
    final_state = np.concatenate(state_in_si(train, tuning, tuple(expected.final_state.values)))
    errors = fmu.get_state(train) - final_state
    # Coordinates and rates have different units, and so have a scale each.
    scales = np.abs(final_state).reshape(2, -1).max(axis=1)
    # The bound allows for rounding errors, which each event may amplify.
    assert np.abs(errors / np.repeat(scales, final_state.size // 2)).max() < 1e-10


def driving_torque(train, change, duration):
    """Return the name of the driving body and the torque that accelerates the train.

    The torque, N m, changes the speed of the reference pinion by `change`, rpm, in `duration`, s.
    """
    # The rigid-body motion and all speeds refer to the mesh phase, in rad.
    motion, speeds = acceleration.rigid_motion(train, list(train.body_names))
    pinion_acceleration = change * math.pi / 30.0 / duration
    pinion_speed = abs(float(train.speeds.in_housing[train.reference_pinion.name]))
    phase_acceleration = pinion_acceleration / pinion_speed
    name = acceleration.default_driver(train, speeds)
    index = train.body_names.index(name)
    rotation = train.structure.motions[index, 2] @ motion / train.bodies[index].base_radius
    inertia = motion @ train.structure.mass @ motion
    return name, train.bodies[index].torque + inertia * phase_acceleration / rotation


@needs_compiler
@pytest.mark.parametrize("step", COMMUNICATION_STEPS)
@pytest.mark.parametrize(
    ("train", "start", "stop"),
    # With less damping the run-down would amplify rounding by a factor of a million.
    [
        (two_gears(), 1000.0, 6000.0),
        (two_gears(0.9, material_damping=5000.0), 5000.0, 500.0),
        (two_gears(), 0.0, 3000.0),
    ],
)
def test_accelerated_motion_matches_run_up(tmp_path, train, start, stop, step):
    """Displacements, forces, contacts and phases must equal those of `run_up` at ten instants.

    The torque of the FMU makes the speed change linearly from `start` to `stop`, rpm.
    """
    duration = 0.05
    expected = gearlib.run_up(train, start, stop, duration=duration, samples_per_period=4)
    name, torque = driving_torque(train, stop - start, duration)
    fmu = load_fmu(tmp_path, train, speed=start).start(**{f"torque.{name}": torque})
    displacement_scale = np.abs(expected.displacement).max()
    for sample in range(20, expected.time.size, expected.time.size // 9):
        fmu.run(float(expected.time[sample]), step)
        displacement, force = fmu.get("displacement.pinion-wheel", "mesh_force.pinion-wheel")
        phase, expected_phase = fmu.get("phase")[0], float(expected.phase[sample])
        # The bounds allow for rounding errors, which events amplify.
        assert abs(displacement - expected.displacement[sample, 0]) < 1e-10 * displacement_scale
        assert abs(force - expected.dynamic_force[sample, 0]) < 1e-9 * train.load
        assert fmu.get_integer("contact.pinion-wheel") == expected.contact[sample, 0]
        assert phase == pytest.approx(expected_phase, rel=1e-12, abs=1e-10)
    fmu.run(duration, step)
    assert fmu.get_integer("events") == expected.event.size
    pinion_teeth, pinion_speed = 24.0, stop * math.pi / 30.0
    assert fmu.get("phase_rate")[0] == pytest.approx(pinion_teeth * pinion_speed, rel=1e-12)


@needs_compiler
def test_reversing_motion_matches_integration_by_scipy(tmp_path):
    """A train whose rotation reverses must follow an integration of its equations by scipy."""
    # The torque of the wheel stops the train after 11 ms and reverses its rotation.
    wheel_torque, end = 190.0, 0.02
    train = two_gears(rigid=True, deviation=Harmonics(), backlash=math.inf)
    mesh, teeth, radii = train.meshes[0], train.bodies[0].teeth, np.array([0.045, 0.0675])
    fmu = load_fmu(tmp_path, train, speed=200.0).start(**{"torque.wheel": wheel_torque})
    masses = np.array([0.005, 0.02]) / radii**2
    forces = np.array([100.0, wheel_torque]) / radii

    def rigid_body_rotation(u):
        """Return the arc length, m, of the rigid-body rotation, which determines the phase."""
        return (masses[0] * u[0] - masses[1] * u[1]) / masses.sum()

    def derivatives(t, state):
        """Return the time derivatives of displacements, m, and velocities on the base circles."""
        u, v = np.split(state, 2)
        rotation = rigid_body_rotation(u) - rigid_body_rotation(start)
        phase = rotation / radii[0] * teeth
        # For the contact ratio 1.6, two pairs of teeth touch in 0.3 of a period on either side.
        is_high = abs((phase / math.tau + 0.5) % 1.0 - 0.5) < 0.3
        stiffness = mesh.max_stiffness * (1.0 if is_high else mesh.stiffness_ratio)
        mesh_force = stiffness * u.sum() + mesh.material_damping * v.sum()
        return [*v, *((forces - mesh_force) / masses)]

    start = radii * fmu.get("angle.pinion", "angle.wheel")
    initial_state = [*start, *(radii * fmu.get("speed.pinion", "speed.wheel"))]
    # Steps must be short, because the solver does not know the switches of the stiffness.
    options = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-14, "max_step": 2e-6}
    expected = solve_ivp(derivatives, (0.0, end), initial_state, **options).y[:, -1]
    assert expected[2] < 0.0  # the velocity of the pinion
    fmu.run(end, 1e-3)
    fmu_state = fmu.get("angle.pinion", "angle.wheel", "speed.pinion", "speed.wheel")
    # The tolerances allow for the switches within steps of scipy.
    assert fmu_state * [*radii, *radii] == pytest.approx(expected, rel=1e-5)
    displacement = fmu.get("displacement.pinion-wheel")[0]
    assert displacement == pytest.approx(expected[:2].sum(), rel=1e-4)


@needs_compiler
def test_each_event_changes_a_contact_in_event_mode(tmp_path):
    """In Event Mode, steps must end at events, at the times that the library finds.

    At each event the displacement must be on a flank line, 0 or minus the backlash.
    """
    train, backlash, end, step = two_gears(), 20e-6, 0.02, 1e-3
    options = {"prescribed_speed": True, "speed": 1.3 * train.speed(1.0)}
    event_times = []
    fmu = load_fmu(tmp_path, train, event_mode=True, **options).start()
    run_without_event_mode = Instance(tmp_path / "train.fmu").start().run(end, step)
    while fmu.time < end:
        has_event, ended_early = fmu.step(min(fmu.time + step, end))
        if has_event:
            # The event is counted, and the contact changes, when it is handled in Event Mode.
            assert ended_early and fmu.get_integer("events") == len(event_times)
            contact_before = fmu.get_integer("contact.pinion-wheel")
            displacement = fmu.get("displacement.pinion-wheel")[0]
            assert min(abs(displacement), abs(displacement + backlash)) < 1e-14
            fmu.enter_event_mode()
            event_times.append(fmu.time)
            assert fmu.get_integer("events") == len(event_times)
            assert abs(fmu.get_integer("contact.pinion-wheel") - contact_before) == 1
    assert len(event_times) == run_without_event_mode.get_integer("events") > 50
    final_state = run_without_event_mode.get_state(train)
    assert fmu.get_state(train) == pytest.approx(final_state, rel=1e-8)
    # The first 40 mesh periods have 28 events.
    run = gearlib.simulate(
        train, speed=options["speed"], periods=40, record_periods=40, initial_state="static"
    )
    expected_times = run.event_phase.values / train.mesh_frequency(1.3)
    assert expected_times.size == 28
    assert event_times[:28] == pytest.approx(expected_times, rel=0.0, abs=1e-14)


@needs_compiler
def test_a_saved_state_is_restored_and_serialised(tmp_path):
    """A restored instance must end in identical bits, one initialised by variables nearly so."""
    train, path = two_gears(), tmp_path / "train.fmu"
    saved_time, end, step = 0.005, 0.02, 1e-3
    fmu = load_fmu(tmp_path, train, speed=0.9 * train.speed(1.0)).start().run(saved_time, step)
    saved_state = fmu.serialise()
    final_state = fmu.run(end, step).get_state(train)
    restored_instance = Instance(path).start().restore(saved_state, saved_time).run(end, step)
    assert np.array_equal(restored_instance.get_state(train), final_state)
    fmu.restore(saved_state, saved_time)
    assert np.array_equal(fmu.run(end, step).get_state(train), final_state)
    with pytest.raises(RuntimeError, match="not those of a state of this FMU"):
        fmu.restore(saved_state[:-8], 0.0)
    # A new instance that is initialised with the variables continues the motion.
    fmu.restore(saved_state, saved_time)
    names = [name for name in fmu.references if name[:2] in ("q.", "v.") or "phase" in name]
    values = dict(zip(names, fmu.get(*names), strict=True))
    initialised_instance = Instance(path)
    initialised_instance.time = saved_time
    initialised_instance.start(**values).run(end, step)
    # The variables are converted from internal units, which rounds them.
    assert initialised_instance.get_state(train) == pytest.approx(final_state, rel=1e-8)
    fmu.call("Reset")
    fmu.time = 0.0
    assert fmu.start().run(end, step).get_state(train) == pytest.approx(final_state, rel=1e-8)


@needs_compiler
def test_backlash_and_torques_can_be_changed(tmp_path):
    """An FMU with changed inputs must move as the FMU of a train with these values."""
    train, new_backlash, pinion_torque, wheel_torque = two_gears(), 50e-6, 50.0, 75.0
    speed, end, step = 1.3 * train.speed(1.0), 0.02, 1e-3
    fmu = load_fmu(tmp_path, train, prescribed_speed=True, speed=speed)
    fmu.start(**{"backlash.pinion-wheel": new_backlash, "torque.wheel": wheel_torque})
    # To keep the speed, the pinion balances the torque of the wheel, whose radius is 1.5 times its.
    assert fmu.get("torque.pinion")[0] == pytest.approx(pinion_torque, rel=1e-12)
    changed_train = two_gears(backlash=new_backlash)
    pinion, wheel = changed_train.bodies
    bodies = [replace(pinion, torque=pinion_torque), replace(wheel, torque=wheel_torque)]
    changed_train = changed_train.replace(bodies=bodies)
    changed_fmu = load_fmu(tmp_path, changed_train, prescribed_speed=True, speed=speed)
    changed_fmu.start_at(changed_train, *np.split(fmu.get_state(train), 2))
    displacements = [
        instance.run(end, step).get("displacement.pinion-wheel")[0]
        for instance in (fmu, changed_fmu)
    ]
    assert displacements[0] == pytest.approx(displacements[1], rel=1e-7)
    # Without backlash one of the flanks is always in contact.
    fmu.set({"backlash.pinion-wheel": 0.0})
    fmu.run(end + step, step)
    assert fmu.get_integer("contact.pinion-wheel") != 0
    for name, value in (("backlash.pinion-wheel", -1e-6), ("torque.wheel", math.nan)):
        with pytest.raises(RuntimeError, match="is not allowed for value reference"):
            fmu.set({name: value})


@needs_compiler
def test_bearing_forces_balance_the_mesh_force(tmp_path):
    """Bearings must carry the mesh force along the line of action, a planet's pin both of its."""
    train = two_gears()
    fmu = load_fmu(tmp_path, train, prescribed_speed=True).start()
    mesh_force, *bearing_forces = fmu.get(
        "mesh_force.pinion-wheel",
        *(f"bearing_force.{body}.{axis}" for body in ("pinion", "wheel") for axis in "xy"),
    )
    # The line of action is given by its angle to the x axis.
    angle = train.meshes[0].line
    force_vector = mesh_force * np.array([math.cos(angle), math.sin(angle)])
    assert bearing_forces == pytest.approx([*-force_vector, *force_vector], rel=1e-12)
    train = gearlib.planetary(support_stiffness=(1e8, math.inf, 1e8, math.inf))
    fmu = load_fmu(tmp_path, train, prescribed_speed=True).start()
    sun_force, ring_force = fmu.get("mesh_force.sun 1", "mesh_force.ring 1")
    (tangential_force,) = fmu.get("bearing_force.planet 1.tangential")
    # Both forces are inclined to the tangential direction by the pressure angle.
    expected = (sun_force + ring_force) * math.cos(math.radians(24.6))
    assert abs(tangential_force) == pytest.approx(expected, rel=1e-6)


@needs_compiler
def test_the_binary_runs_without_python(tmp_path):
    """The binary must not be linked to Python, and writing it again must give the same bytes."""
    path = tmp_path / "train.fmu"
    gearlib.write_fmu(two_gears(), path)
    binary = Instance(path).binary
    if shutil.which("ldd"):
        libraries = subprocess.run(["ldd", binary], capture_output=True, text=True).stdout
        assert "libm" in libraries and "python" not in libraries
    content = path.read_bytes()
    gearlib.write_fmu(two_gears(), path)
    assert path.read_bytes() == content


#: A C program that runs the FMU up to the time END and prints displacement and number of events.
MAIN_PROGRAM = """
#include "gear_train.c"
int main(void) {
    bool event, terminate, early;
    double last_time, displacement;
    Reference reference = VR_DISPLACEMENT;
    void *fmu = fmi3InstantiateCoSimulation(
        "a", TOKEN, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    fmi3EnterInitializationMode(fmu, false, 0.0, 0.0, false, 0.0);
    fmi3ExitInitializationMode(fmu);
    if (fmi3DoStep(fmu, 0.0, END, true, &event, &terminate, &early, &last_time)) return 1;
    fmi3GetFloat64(fmu, &reference, 1, &displacement, 1);
    printf("%.17g %d\\n", displacement, ((Instance *)fmu)->s.events);
    fmi3FreeInstance(fmu);
    return 0;
}
"""


@needs_compiler
def test_the_sources_compile_without_warnings_and_run(tmp_path):
    """A program compiled from the sources with sanitizers must end in the state of `simulate`."""
    train, tuning, periods = two_gears(), 1.3, 10
    path = tmp_path / "train.fmu"
    gearlib.write_fmu(train, path, prescribed_speed=True, speed=tuning * train.speed(1.0))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    sources = tmp_path / "sources"
    # The source file is meant to be short enough to be read.
    assert len((sources / "gear_train.c").read_text().splitlines()) <= 800
    end = periods * math.tau / train.mesh_frequency(tuning)
    (sources / "main.c").write_text(MAIN_PROGRAM.replace("END", repr(end)))
    flags = "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-g"
    sanitizers = "-fsanitize=address,undefined", "-fno-sanitize-recover"
    command = [COMPILER, *flags, *sanitizers, "-o", "run", "main.c", "-lm"]
    subprocess.run(command, cwd=sources, check=True)
    process = subprocess.run([sources / "run"], capture_output=True, text=True, check=True)
    displacement, events = process.stdout.split()
    options = {"periods": periods, "record_periods": periods, "initial_state": "static"}
    expected = gearlib.simulate(train, tuning, **options)
    coordinates = expected.final_state.values[: train.size // 2] * train.static_deflection
    deviation_at_phase_0 = 2e-6
    expected_displacement = float(train.structure.mesh_jacobian[0] @ coordinates)
    expected_displacement += deviation_at_phase_0
    assert float(displacement) == pytest.approx(expected_displacement, rel=1e-9)
    assert int(events) == expected.event.size


def test_without_a_compiler_the_fmu_holds_sources_only(tmp_path, monkeypatch):
    """Without a C compiler, `write_fmu` must warn and write an FMU without a binary."""
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.warns(UserWarning, match="sources but no binary, because there is no C compiler"):
        gearlib.write_fmu(two_gears(), tmp_path / "train.fmu")
    with zipfile.ZipFile(tmp_path / "train.fmu") as archive:
        names = archive.namelist()
    assert "sources/gear_train.c" in names and not any("binaries" in name for name in names)


GEAR_PAIR = gearlib.GearPair.from_ratios(contact_ratio=1.6, stiffness_ratio=0.7)


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (
            GEAR_PAIR,
            {},
            "model of type GearPair is not allowed: it must be a GearTrain, because it",
        ),
        (
            two_gears(friction=(0.1, 0.0)),
            {},
            r"friction of mesh pinion-wheel = \(0.1, 0.0\) is not allowed: it must be 0 in an FMU",
        ),
        (two_gears(material_damping=None), {}, "damping_ratio of mesh pinion-wheel is missing"),
        (
            gearlib.planetary(turning=True, gyroscopic=True),
            {},
            "gyroscopic = True is not allowed: it must be False in an FMU whose speed is not pre",
        ),
        (
            two_gears().replace(
                bodies=[replace(body, torsional_stiffness=1e4) for body in two_gears().bodies]
            ),
            {},
            "prescribed_speed = False is not allowed: it must be True, because the train has no",
        ),
        (two_gears(), {"speed": -1.0}, "speed = -1.0 is not allowed"),
    ],
)
def test_models_and_paths_that_cannot_be_exported_are_refused(tmp_path, model, options, message):
    """The error must name what an FMU does not support, or the wrong file name extension."""
    with pytest.raises(ValueError, match=message):
        gearlib.write_fmu(model, tmp_path / "train.fmu", **options)
    with pytest.raises(ValueError, match="path = 'train.zip' is not allowed: it must be a name"):
        gearlib.write_fmu(model, "train.zip")


@needs_compiler
def test_fmpy_validates_and_simulates(tmp_path):
    """FMPy must find no problem, and the motion must not depend on the use of Event Mode."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy import validation

    train = two_gears()
    path = str(tmp_path / "train.fmu")
    gearlib.write_fmu(train, path, prescribed_speed=True, speed=train.speed(1.3))
    assert validation.validate_fmu(path) == []
    # Loading by FMPy also checks that the binary has all 75 functions of the standard.
    variables = ["displacement.pinion-wheel", "contact.pinion-wheel", "events", "speed.wheel"]
    options = {"stop_time": 0.01, "output_interval": 1e-3, "output": variables}
    plain_run = fmpy.simulate_fmu(path, **options)
    options |= {"use_event_mode": True, "early_return_allowed": True}
    event_mode_run = fmpy.simulate_fmu(path, **options)
    # Event Mode adds rows at events to the eleven rows at output times.
    assert len(event_mode_run) > len(plain_run) == 11
    for name in variables:
        assert event_mode_run[name][-1] == pytest.approx(plain_run[name][-1], rel=1e-7)


@needs_compiler
def test_fmpy_compiles_the_sources(tmp_path):
    """FMPy must be able to build the binary from the sources of the FMU."""
    pytest.importorskip("fmpy")
    if shutil.which("cmake") is None:
        pytest.skip("there is no cmake")
    from fmpy.build import build_platform_binary

    path = tmp_path / "train.fmu"
    gearlib.write_fmu(two_gears(), path)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "train")
    shutil.rmtree(tmp_path / "train/binaries")
    build_platform_binary(tmp_path / "train")
    assert list((tmp_path / "train").glob("binaries/*/*.so"))


@needs_compiler
def test_six_degree_model_is_exported_as_two_gears_with_moving_backlash(tmp_path):
    """After 30 mesh periods with contact loss, the FMU must have the displacement of `simulate`."""
    pair = gearlib.GearPair(
        max_stiffness=4e8,
        stiffness_ratio=0.7,
        contact_ratio=1.6,
        reduced_mass=2.0,
        load=2000.0,
        backlash=30e-6,
        material_damping=1000.0,
        backlash_damping=100.0,
    )
    gears = gearlib.SixDegreePair(
        pair=pair,
        base_radii=(0.034, 0.05),
        inertias=(0.004, 0.01),
        masses=(3.0, 5.0),
        bearing_stiffness=(5e8, 5e8, 6e8, 6e8),
        bearing_damping=(800.0,) * 4,
        teeth=(24, 31),
        eccentricities=(1e-6, 2e-6),
    )
    train, tuning, periods = gears.train, 0.8, 30
    # The only sample lies at the start of the last period.
    expected = gearlib.simulate(gears, tuning, periods=periods + 1, samples_per_period=1)
    initial_state = gears.full_state(train.system(tuning), (0.0, 0.0))[: train.size]
    fmu = load_fmu(tmp_path, gears, prescribed_speed=True, speed=gears.speed(tuning))
    fmu.start_at(train, *state_in_si(train, tuning, tuple(initial_state)))
    fmu.run(periods * math.tau / gears.mesh_frequency(tuning), 1e-3)
    assert fmu.get_integer("events") > 50
    displacement_ratio = fmu.get("displacement.mesh")[0] / gears.static_deflection
    assert displacement_ratio == pytest.approx(float(expected.displacement[0]), abs=1e-10)


@needs_compiler
def test_a_train_of_matrices_with_gyroscopic_forces_is_exported(tmp_path):
    """Compare a periodic motion with `simulate`, and an acceleration with torque over inertia."""
    train = two_rotors(speed=300.0, damping=1e-5 * ROSS_MATRICES["stiffness"]).reduce(1000.0)
    mesh = replace(train.meshes[0], stiffness_ratio=0.8, deviation=Harmonics((2e-6,)))
    train, tuning, periods, step = train.replace(meshes=[mesh]), 1.1, 20, 1e-3
    state = settled_state(train, tuning)
    expected = gearlib.simulate(train, tuning, initial_state=state, periods=periods)
    fmu = load_fmu(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    fmu.start_at(train, *state_in_si(train, tuning, state))
    fmu.run(periods * math.tau / train.mesh_frequency(tuning), step)
    final_state = state_in_si(train, tuning, tuple(expected.final_state.values))
    expected_displacements = mesh_displacements(train, np.concatenate(final_state))
    displacements = mesh_displacements(train, fmu.get_state(train))
    assert displacements == pytest.approx(expected_displacements, rel=1e-8, abs=1e-13)
    # A torque in addition to the balanced ones accelerates the rigid-body rotation.
    torque, start, end = 10.0, 0.1, 0.2
    accelerated_fmu = load_fmu(tmp_path, train, speed=300.0).start(**{"torque.pinion": torque})
    pinion_speed, _ = accelerated_fmu.run(start, step).get("speed.pinion", "speed.wheel")
    final_pinion_speed, final_wheel_speed = accelerated_fmu.run(end, step).get(
        "speed.pinion", "speed.wheel"
    )
    motion, _ = acceleration.rigid_motion(train, ["pinion", "wheel"])
    base_radius, gear_ratio = 0.04, 2.0
    rotation = train.structure.motions[0, 2] @ motion / base_radius
    inertia = motion @ train.structure.mass @ motion / rotation**2
    # Vibrations are superimposed on the rotation.
    expected_change = torque / inertia * (end - start)
    assert final_pinion_speed - pinion_speed == pytest.approx(expected_change, rel=1e-2)
    assert final_wheel_speed == pytest.approx(-final_pinion_speed / gear_ratio, rel=1e-2)


@needs_compiler
def test_the_command_writes_an_fmu_and_keeps_existing_files(tmp_path):
    """The command must write an FMU, refuse to overwrite it and prescribe the speed on request."""
    gearlib.write_train(two_gears(), tmp_path / "train.yaml")
    arguments = ["fmu", str(tmp_path / "train.yaml"), "--speed", "1500rpm"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0 and "written to" in result.output
    phase_rate = Instance(tmp_path / "train.fmu").start().get("phase_rate")[0]
    pinion_teeth, pinion_speed = 24.0, 1500.0 * math.pi / 30.0
    assert phase_rate == pytest.approx(pinion_teeth * pinion_speed, rel=1e-12)
    repeated_result = CliRunner().invoke(main, arguments)
    assert repeated_result.exit_code == 2 and "--force" in repeated_result.output
    path = tmp_path / "prescribed.fmu"
    arguments += ["--prescribed-speed", "-o", str(path)]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    # The speed is an input of an FMU with prescribed speed.
    assert "speed" in Instance(path).references

"""FMUs of gear trains: their motion against the library and scipy, files, states, refusals.

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
from tests.couple import ROSS, two_rotors
from tests.fmu.importer import Instance
from tests.trains import random_trains

COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")
#: Communication steps, s.
STEPS = (1e-5, 1e-4, 1e-3, 1e-2)


def two_gears(stiffness_ratio=0.7, rigid=False, **fields):
    """Return a train of two gears; the pinion has elastic bearings unless `rigid`.

    `fields` are further fields of the mesh.
    """
    elastic = {"support_stiffness": (5e8, 5e8), "support_damping": (500.0, 500.0), "mass": 3.0}
    gears = {"base_radius": 0.045, "inertia": 0.005, "torque": 100.0}
    bodies = [
        Body(name="pinion", teeth=24, **gears, **({} if rigid else elastic)),
        Body(name="wheel", teeth=36, base_radius=0.0675, inertia=0.02, torque=150.0),
    ]
    values = {"backlash": 20e-6, "material_damping": 1500.0, "backlash_damping": 50.0}
    values |= {"deviation": Harmonics((2e-6,), (1e-6,)), "stiffness_ratio": stiffness_ratio}
    mesh = Mesh(
        pinion="pinion", wheel="wheel", max_stiffness=4e8, contact_ratio=1.6, **(values | fields)
    )
    return gearlib.GearTrain(bodies=bodies, meshes=[mesh])


#: A ripple of the torque at twice the mesh frequency, and a force that turns with the pinion.
RIPPLE = HarmonicForce(body="wheel", amplitude=15.0, order=2, of="pinion-wheel", phase=0.3)
UNBALANCE = HarmonicForce(body="pinion", amplitude=60.0, order=1, of="pinion", axis="y")


def settled(train, tuning, periods=3000):
    """Return the state of the settled motion at the start of a mesh period."""
    run = gearlib.simulate(train, tuning, periods=periods, initial_state="static")
    assert int(run.status) == 0
    return tuple(run.final_state.values.tolist())


def fmu_of(folder, train, event_mode=False, **options):
    """Write the FMU of a train and return an instance of it."""
    path = folder / "train.fmu"
    gearlib.write_fmu(train, path, **options)
    return Instance(path, event_mode)


def si_state(train, tuning, state):
    """Return a state of the library as (coordinates in m, rates in m/s)."""
    q, rates = np.split(train.start_state(state), 2)
    length = train.static_deflection
    return q * length, rates * length * train.mesh_frequency(tuning)


def distances(train, state):
    """Return displacements and rates of the meshes for a state, without deviations."""
    return np.concatenate([train.structure.lines @ part for part in np.split(state, 2)])


@needs_compiler
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize(
    ("train", "tuning"),
    [
        (two_gears(), 0.95),
        (two_gears(), 1.3),
        (two_gears().replace(forces=[RIPPLE, UNBALANCE]), 1.3),
    ],
)
def test_settled_motion_matches_simulate(tmp_path, train, tuning, step):
    """The FMU must end 200 mesh periods in the state that `simulate` computes."""
    # In 200 mesh periods with hundreds of events rounding adds up to about 1e-12.
    state = settled(train, tuning)
    run = {"periods": 200, "record_periods": 200, "samples_per_period": 1}
    expected = gearlib.simulate(train, tuning, **run, initial_state=state)
    fmu = fmu_of(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    fmu.start_at(train, *si_state(train, tuning, state))
    fmu.run(200.0 * math.tau / train.mesh_frequency(tuning), step)
    fmu_distances = distances(train, fmu.state(train))
    final = np.concatenate(si_state(train, tuning, tuple(expected.final_state.values)))
    final = distances(train, final)
    scale = np.repeat(np.abs(final).reshape(2, -1).max(axis=1), len(train.meshes))
    assert np.abs((fmu_distances - final) / scale).max() < 1e-10
    assert fmu.integer("events") == expected.event.size > 100


@needs_compiler
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["random_problem", "jamming_problem", "symmetric_problem"])
def test_events_of_a_random_train_match_simulate(tmp_path, kind, seed):
    """Compare the number of events, the final state and jamming with the library."""
    train, tuning, state = getattr(random_trains, kind)(np.random.default_rng(seed))
    train = train.replace(meshes=[replace(mesh, friction=(0.0, 0.0)) for mesh in train.meshes])
    run = {"periods": 8, "record_periods": 8, "samples_per_period": 1}
    expected = gearlib.simulate(train, tuning, **run, initial_state=tuple(state))
    fmu = fmu_of(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    end = 8.0 * math.tau / train.mesh_frequency(tuning)
    jams = int(expected.status) != 0
    try:
        fmu.start_at(train, *si_state(train, tuning, tuple(state))).run(end, end / 5.3)
    except RuntimeError as error:
        assert jams and "both flanks" in str(error)
        return
    assert not jams
    assert fmu.integer("events") == expected.event.size
    final = np.concatenate(si_state(train, tuning, tuple(expected.final_state.values)))
    scale = np.repeat(np.abs(final).reshape(2, -1).max(axis=1), final.size // 2)
    # In unsettled motions each event amplifies the rounding error.
    assert np.abs((fmu.state(train) - final) / scale).max() < 1e-10


def driving_torque(train, change, duration):
    """Return (driving body, torque) that changes the speed of the reference pinion.

    `change` is in rpm and takes place within `duration`, s.
    """
    motion, speeds = acceleration.rigid_motion(train, list(train.body_names))
    rate = change * math.pi / 30.0 / duration
    rate /= abs(float(train.speeds.in_housing[train.reference_pinion.name]))
    name = acceleration.default_driver(train, speeds)
    i = train.body_names.index(name)
    rotation = train.structure.motions[i, 2] @ motion / train.bodies[i].base_radius
    return name, train.bodies[i].torque + motion @ train.structure.mass @ motion * rate / rotation


@needs_compiler
@pytest.mark.parametrize("step", STEPS)
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
    """Compare displacements, forces, contacts and phases at ten instants with `run_up`."""
    expected = gearlib.run_up(train, start, stop, duration=0.05, samples_per_period=4)
    name, torque = driving_torque(train, stop - start, 0.05)
    fmu = fmu_of(tmp_path, train, speed=start).start(**{f"torque.{name}": torque})
    for sample in range(20, expected.time.size, expected.time.size // 9):
        fmu.run(float(expected.time[sample]), step)
        displacement, force = fmu.get("displacement.pinion-wheel", "mesh_force.pinion-wheel")
        scale = np.abs(expected.displacement).max()
        assert abs(displacement - expected.displacement[sample, 0]) < 1e-10 * scale
        assert abs(force - expected.dynamic_force[sample, 0]) < 1e-9 * train.load
        assert fmu.integer("contact.pinion-wheel") == expected.contact[sample, 0]
        assert fmu.get("phase")[0] == pytest.approx(
            float(expected.phase[sample]), rel=1e-12, abs=1e-10
        )
    fmu.run(0.05, step)
    assert fmu.integer("events") == expected.event.size
    # The pinion has 24 teeth.
    assert fmu.get("phase_rate")[0] == pytest.approx(24.0 * stop * math.pi / 30.0, rel=1e-12)


@needs_compiler
def test_reversing_motion_matches_integration_by_scipy(tmp_path):
    """A train whose rotation reverses must follow an integration by scipy."""
    # The wheel stops the train after 11 ms and reverses its rotation.
    train = two_gears(rigid=True, deviation=Harmonics(), backlash=math.inf)
    (mesh,), gears, radii = train.meshes, train.bodies, np.array([0.045, 0.0675])
    fmu = fmu_of(tmp_path, train, speed=200.0).start(**{"torque.wheel": 190.0})
    mass, force = np.array([0.005, 0.02]) / radii**2, np.array([100.0, 190.0]) / radii

    def rigid_rotation(u):
        """Return the arc length of the rotation to which the phase belongs."""
        return (mass[0] * u[0] - mass[1] * u[1]) / mass.sum()

    def rates(t, y):
        """Return the derivatives of displacements and velocities."""
        u, v = np.split(y, 2)
        phase = (rigid_rotation(u) - rigid_rotation(start)) / radii[0] * gears[0].teeth
        is_high = abs((phase / math.tau + 0.5) % 1.0 - 0.5) < 0.3
        stiffness = mesh.max_stiffness * (1.0 if is_high else 0.7)
        contact = stiffness * u.sum() + 1500.0 * v.sum()
        return [*v, *((force - contact) / mass)]

    start = radii * fmu.get("angle.pinion", "angle.wheel")
    state = [*start, *(radii * fmu.get("speed.pinion", "speed.wheel"))]
    # Steps must be short, because the solver does not know the switches of the stiffness.
    options = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-14, "max_step": 2e-6}
    exact = solve_ivp(rates, (0.0, 0.02), state, **options).y[:, -1]
    fmu.run(0.02, 1e-3)
    assert exact[2] < 0.0
    fmu_state = fmu.get("angle.pinion", "angle.wheel", "speed.pinion", "speed.wheel")
    assert fmu_state * [*radii, *radii] == pytest.approx(exact, rel=1e-5)
    assert fmu.get("displacement.pinion-wheel")[0] == pytest.approx(exact[:2].sum(), rel=1e-4)


@needs_compiler
def test_each_event_changes_a_contact_in_event_mode(tmp_path):
    """Steps must end at events on flank lines, at the times that the library finds."""
    train = two_gears()
    options = {"prescribed_speed": True, "speed": 1.3 * train.speed(1.0)}
    events, contact, times = 0, [], []
    fmu = fmu_of(tmp_path, train, event_mode=True, **options).start()
    reference = Instance(tmp_path / "train.fmu").start().run(0.02, 1e-3)
    while fmu.time < 0.02:
        happens, early = fmu.step(min(fmu.time + 1e-3, 0.02))
        if happens:
            assert early and fmu.integer("events") == events
            contact.append(fmu.integer("contact.pinion-wheel"))
            displacement = fmu.get("displacement.pinion-wheel")[0]
            assert min(abs(displacement), abs(displacement + 20e-6)) < 1e-14
            fmu.enter_event_mode()
            events, times = events + 1, [*times, fmu.time]
            assert fmu.integer("events") == events
            assert abs(fmu.integer("contact.pinion-wheel") - contact[-1]) == 1
    assert events == reference.integer("events") > 50
    assert fmu.state(train) == pytest.approx(reference.state(train), rel=1e-8)
    expected = gearlib.simulate(
        train, speed=options["speed"], periods=40, record_periods=40, initial_state="static"
    )
    expected = expected.event_phase.values / train.mesh_frequency(1.3)
    assert expected.size == 28
    assert times[:28] == pytest.approx(expected, rel=0.0, abs=1e-14)


@needs_compiler
def test_a_saved_state_is_restored_and_serialised(tmp_path):
    """A restored state must lead to the same bits, and values of variables to nearly the same."""
    train = two_gears()
    fmu = fmu_of(tmp_path, train, speed=0.9 * train.speed(1.0)).start().run(0.005, 1e-3)
    state = fmu.serialised()
    end = fmu.run(0.02, 1e-3).state(train)
    restored_instance = (
        Instance(tmp_path / "train.fmu").start().restore(state, 0.005).run(0.02, 1e-3)
    )
    assert np.array_equal(restored_instance.state(train), end)
    fmu.restore(state, 0.005)
    assert np.array_equal(fmu.run(0.02, 1e-3).state(train), end)
    with pytest.raises(RuntimeError, match="not those of a state of this FMU"):
        fmu.restore(state[:-8], 0.0)
    # A new instance that is initialised with the variables continues from there.
    fmu.restore(state, 0.005)
    names = [name for name in fmu.references if name[:2] in ("q.", "v.") or "phase" in name]
    values = dict(zip(names, fmu.get(*names), strict=True))
    initialised_instance = Instance(tmp_path / "train.fmu")
    initialised_instance.time = 0.005
    assert initialised_instance.start(**values).run(0.02, 1e-3).state(train) == pytest.approx(
        end, rel=1e-8
    )
    fmu.call("Reset")
    fmu.time = 0.0
    assert fmu.start().run(0.02, 1e-3).state(train) == pytest.approx(end, rel=1e-8)


@needs_compiler
def test_backlash_and_torques_can_be_changed(tmp_path):
    train = two_gears()
    speed, end = 1.3 * train.speed(1.0), 0.02
    fmu = fmu_of(tmp_path, train, prescribed_speed=True, speed=speed)
    fmu.start(**{"backlash.pinion-wheel": 50e-6, "torque.wheel": 75.0})
    # The pinion balances the torque of the wheel, to keep the speed.
    assert fmu.get("torque.pinion")[0] == pytest.approx(50.0, rel=1e-12)
    changed = two_gears(backlash=50e-6)
    bodies = zip(changed.bodies, (50.0, 75.0), strict=True)
    changed = changed.replace(bodies=[replace(body, torque=torque) for body, torque in bodies])
    changed_fmu = fmu_of(tmp_path, changed, prescribed_speed=True, speed=speed)
    changed_fmu.start_at(changed, *np.split(fmu.state(train), 2))
    ends = [x.run(end, 1e-3).get("displacement.pinion-wheel")[0] for x in (fmu, changed_fmu)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-7)
    fmu.set({"backlash.pinion-wheel": 0.0})
    fmu.run(0.021, 1e-3)
    assert fmu.integer("contact.pinion-wheel") != 0
    for name, value in (("backlash.pinion-wheel", -1e-6), ("torque.wheel", math.nan)):
        with pytest.raises(RuntimeError, match="is not allowed for value reference"):
            fmu.set({name: value})


@needs_compiler
def test_bearing_forces_balance_the_mesh_force(tmp_path):
    """Bearing forces must be opposite to the mesh force along the line of action."""
    train = two_gears()
    fmu = fmu_of(tmp_path, train, prescribed_speed=True).start()
    force, *bearings = fmu.get(
        "mesh_force.pinion-wheel",
        *(f"bearing_force.{body}.{axis}" for body in ("pinion", "wheel") for axis in "xy"),
    )
    line = train.meshes[0].line
    expected = force * np.array([math.cos(line), math.sin(line)])
    assert bearings == pytest.approx([*-expected, *expected], rel=1e-12)
    # A rigid pin of a planet carries the forces of both meshes.
    train = gearlib.planetary(support_stiffness=(1e8, math.inf, 1e8, math.inf))
    fmu = fmu_of(tmp_path, train, prescribed_speed=True).start()
    sun, ring = fmu.get("mesh_force.sun 1", "mesh_force.ring 1")
    pin = fmu.get("bearing_force.planet 1.radial", "bearing_force.planet 1.tangential")
    assert abs(pin[1]) == pytest.approx((sun + ring) * math.cos(math.radians(24.6)), rel=1e-6)


@needs_compiler
def test_the_binary_runs_without_python(tmp_path):
    gearlib.write_fmu(two_gears(), tmp_path / "train.fmu")
    binary = Instance(tmp_path / "train.fmu").binary
    if shutil.which("ldd"):
        libraries = subprocess.run(["ldd", binary], capture_output=True, text=True).stdout
        assert "libm" in libraries and "python" not in libraries
    first = (tmp_path / "train.fmu").read_bytes()
    gearlib.write_fmu(two_gears(), tmp_path / "train.fmu")
    assert (tmp_path / "train.fmu").read_bytes() == first


#: Ten mesh periods in C, without an importer.
MAIN = """
#include "gear_train.c"
int main(void) {
    bool event, terminate, early;
    double last, value;
    Reference displacement = VR_DISPLACEMENT;
    void *x = fmi3InstantiateCoSimulation(
        "a", TOKEN, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    fmi3EnterInitializationMode(x, false, 0.0, 0.0, false, 0.0);
    fmi3ExitInitializationMode(x);
    if (fmi3DoStep(x, 0.0, END, true, &event, &terminate, &early, &last)) return 1;
    fmi3GetFloat64(x, &displacement, 1, &value, 1);
    printf("%.17g %d\\n", value, ((Instance *)x)->s.events);
    fmi3FreeInstance(x);
    return 0;
}
"""


@needs_compiler
def test_the_sources_compile_without_warnings_and_run(tmp_path):
    """Compile a program with sanitizers, run ten mesh periods and compare with the library."""
    train = two_gears()
    path = tmp_path / "train.fmu"
    gearlib.write_fmu(train, path, prescribed_speed=True, speed=1.3 * train.speed(1.0))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    sources = tmp_path / "sources"
    assert len((sources / "gear_train.c").read_text().splitlines()) <= 800
    end = 10.0 * math.tau / train.mesh_frequency(1.3)
    (sources / "main.c").write_text(MAIN.replace("END", repr(end)))
    flags = "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1", "-g"
    sanitizers = "-fsanitize=address,undefined", "-fno-sanitize-recover"
    command = [COMPILER, *flags, *sanitizers, "-o", "run", "main.c", "-lm"]
    subprocess.run(command, cwd=sources, check=True)
    process = subprocess.run([sources / "run"], capture_output=True, text=True, check=True)
    displacement, events = process.stdout.split()
    run = {"periods": 10, "record_periods": 10, "initial_state": "static"}
    expected = gearlib.simulate(train, 1.3, **run)
    q = expected.final_state.values[: train.size // 2] * train.static_deflection
    # The deviation at phase 0 is 2 um.
    final = float(train.structure.lines[0] @ q) + 2e-6
    assert float(displacement) == pytest.approx(final, rel=1e-9)
    assert int(events) == expected.event.size


def test_without_a_compiler_the_fmu_holds_sources_only(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.warns(UserWarning, match="sources but no binary, because there is no C compiler"):
        gearlib.write_fmu(two_gears(), tmp_path / "train.fmu")
    with zipfile.ZipFile(tmp_path / "train.fmu") as archive:
        names = archive.namelist()
    assert "sources/gear_train.c" in names and not any("binaries" in name for name in names)


def pair():
    """Return a gear pair, a model without bodies."""
    return gearlib.GearPair.from_ratios(contact_ratio=1.6, stiffness_ratio=0.7)


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (pair(), {}, "model of type GearPair is not allowed: it must be a GearTrain, because it"),
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
                bodies=[replace(x, torsional_stiffness=1e4) for x in two_gears().bodies]
            ),
            {},
            "prescribed_speed = False is not allowed: it must be True, because the train has no",
        ),
        (two_gears(), {"speed": -1.0}, "speed = -1.0 is not allowed"),
    ],
)
def test_models_and_paths_that_cannot_be_exported_are_refused(tmp_path, model, options, message):
    with pytest.raises(ValueError, match=message):
        gearlib.write_fmu(model, tmp_path / "train.fmu", **options)
    with pytest.raises(ValueError, match="path = 'train.zip' is not allowed: it must be a name"):
        gearlib.write_fmu(model, "train.zip")


@needs_compiler
def test_fmpy_validates_and_simulates(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    from fmpy import validation

    train = two_gears()
    path = str(tmp_path / "train.fmu")
    gearlib.write_fmu(train, path, prescribed_speed=True, speed=train.speed(1.3))
    assert validation.validate_fmu(path) == []
    # Loading by FMPy also checks that the binary has all 75 functions of the standard.
    output = ["displacement.pinion-wheel", "contact.pinion-wheel", "events", "speed.wheel"]
    settings = {"stop_time": 0.01, "output_interval": 1e-3, "output": output}
    plain = fmpy.simulate_fmu(path, **settings)
    events = fmpy.simulate_fmu(path, **settings, use_event_mode=True, early_return_allowed=True)
    assert len(events) > len(plain) == 11
    for name in output:
        assert events[name][-1] == pytest.approx(plain[name][-1], rel=1e-7)


@needs_compiler
def test_fmpy_compiles_the_sources(tmp_path):
    """Remove the binary and build it again with the tools of FMPy."""
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
    """Compare the displacement after 30 mesh periods, with contact loss, with the library."""
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
    train, tuning = gears.train, 0.8
    expected = gearlib.simulate(gears, tuning, periods=31, samples_per_period=1)
    start = gears.full_state(train.system(tuning), (0.0, 0.0))[: train.size]
    fmu = fmu_of(tmp_path, gears, prescribed_speed=True, speed=gears.speed(tuning))
    fmu.start_at(train, *si_state(train, tuning, tuple(start)))
    fmu.run(30.0 * math.tau / gears.mesh_frequency(tuning), 1e-3)
    assert fmu.integer("events") > 50
    displacement_ratio = fmu.get("displacement.mesh")[0] / gears.static_deflection
    assert displacement_ratio == pytest.approx(float(expected.displacement[0]), abs=1e-10)


@needs_compiler
def test_a_train_of_matrices_with_gyroscopic_forces_is_exported(tmp_path):
    """Compare a settled motion, and the acceleration by an additional torque."""
    train = two_rotors(speed=300.0, damping=1e-5 * ROSS["stiffness"]).reduce(1000.0)
    mesh = replace(train.meshes[0], stiffness_ratio=0.8, deviation=Harmonics((2e-6,)))
    train, tuning = train.replace(meshes=[mesh]), 1.1
    state = settled(train, tuning)
    expected = gearlib.simulate(train, tuning, initial_state=state, periods=20)
    fmu = fmu_of(tmp_path, train, prescribed_speed=True, speed=train.speed(tuning))
    fmu.start_at(train, *si_state(train, tuning, state))
    fmu.run(20.0 * math.tau / train.mesh_frequency(tuning), 1e-3)
    final = si_state(train, tuning, tuple(expected.final_state.values))
    final = distances(train, np.concatenate(final))
    assert distances(train, fmu.state(train)) == pytest.approx(final, rel=1e-8, abs=1e-13)
    # A torque in addition to the balanced ones accelerates the rigid-body rotation.
    free = fmu_of(tmp_path, train, speed=300.0).start(**{"torque.pinion": 10.0})
    rates = [free.run(end, 1e-3).get("speed.pinion", "speed.wheel") for end in (0.1, 0.2)]
    inertia = train.structure.mass
    motion, _ = acceleration.rigid_motion(train, ["pinion", "wheel"])
    turn = train.structure.motions[0, 2] @ motion / 0.04
    expected = 10.0 * turn**2 / (motion @ inertia @ motion) * 0.1
    assert rates[1][0] - rates[0][0] == pytest.approx(expected, rel=1e-2)
    assert rates[1][1] == pytest.approx(-rates[1][0] / 2.0, rel=1e-2)


@needs_compiler
def test_the_command_writes_an_fmu_and_keeps_existing_files(tmp_path):
    """Write an FMU, refuse to write it again, and prescribe its speed."""
    gearlib.write_train(two_gears(), tmp_path / "train.yaml")
    arguments = ["fmu", str(tmp_path / "train.yaml"), "--speed", "1500rpm"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0 and "written to" in result.output
    rate = Instance(tmp_path / "train.fmu").start().get("phase_rate")[0]
    assert rate == pytest.approx(24.0 * 50.0 * math.pi, rel=1e-12)
    repeated_result = CliRunner().invoke(main, arguments)
    assert repeated_result.exit_code == 2 and "--force" in repeated_result.output
    output = str(tmp_path / "held.fmu")
    prescribed_result = CliRunner().invoke(main, [*arguments, "--prescribed-speed", "-o", output])
    assert prescribed_result.exit_code == 0
    assert "speed" in Instance(tmp_path / "held.fmu").references

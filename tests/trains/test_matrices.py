"""Structures of other tools as matrices, their reduction, forces on bodies, state space."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import gearlib
from gearlib import Body, GearNode, GearTrain, HarmonicForce, Mesh
from tests.couple import ROSS_MATRICES, ROSS_NATURAL_FREQUENCIES, two_rotors


def pair_of_bodies(stiffness_ratio=1.0, **options):
    """Return a train of two gears on fixed axes, with damping."""
    bodies = [
        Body(name="a", inertia=0.01, base_radius=0.1, teeth=20, torque=100.0),
        Body(name="b", inertia=0.04, base_radius=0.2, teeth=40, torque=200.0),
    ]
    mesh = Mesh(
        pinion="a", wheel="b", max_stiffness=3e8, stiffness_ratio=stiffness_ratio, name="m",
        contact_ratio=1.5, backlash=1e-3, material_damping=3000.0, backlash_damping=0.0,
    )  # fmt: skip
    return GearTrain(bodies=bodies, meshes=[mesh], **options)


def pair_of_matrices(**options):
    """Return the train of `pair_of_bodies` as matrices over the angles of both gears, rad."""
    gears = [
        GearNode(name="a", teeth=20, base_radius=0.1, rotation="angle a"),
        GearNode(name="b", teeth=40, base_radius=0.2, rotation="angle b"),
    ]
    arrays = np.diag([0.01, 0.04]), np.zeros((2, 2)), np.zeros((2, 2))
    forces = {"angle a": 100.0, "angle b": 200.0}
    names = ["angle a", "angle b"]
    return GearTrain.from_matrices(
        *arrays,
        pair_of_bodies(stiffness_ratio=0.7).meshes,
        gears,
        coordinates=names,
        forces=forces,
        **options,
    )


def rebuild_from_matrices(train):
    """Return an equal train that is defined by the matrices of its structure."""
    structure = train.structure
    n = len(structure.mass)
    names = [f"{name} {i}" for i, (name, _) in enumerate(structure.coordinates)]
    gears = [
        GearNode(name=body.name, teeth=body.teeth or 20, base_radius=body.base_radius)
        for body in train.bodies
    ]
    rows = {
        mesh.name: line for mesh, line in zip(train.meshes, structure.mesh_jacobian, strict=True)
    }
    forces = {names[i]: float(structure.load[i]) for i in range(n)}
    arrays = structure.mass, structure.damping, structure.stiffness
    options = {"coordinates": names, "forces": forces, "rows": rows, "reference": train.reference}
    return GearTrain.from_matrices(*arrays, train.meshes, gears, **options)


def test_natural_frequencies_match_ross():
    """Natural frequencies of two rotors must equal values computed by the program ROSS."""
    modes = two_rotors().modes()
    frequencies = np.sort(modes.natural_frequency.values)
    assert frequencies[:3] == pytest.approx(0.0, abs=1e-3)
    assert frequencies[3:14] == pytest.approx(ROSS_NATURAL_FREQUENCIES, rel=1e-6)


def test_a_reduction_keeps_frequencies_damping_and_response():
    """Compare eigenvalues and responses up to 1250 Hz of a rotor and its reduction."""
    full_train = two_rotors(speed=300.0, damping=2e-6 * ROSS_MATRICES["stiffness"])
    reduced_train = full_train.reduce(2500.0)
    assert len(reduced_train.matrices.mass) < len(full_train.matrices.mass) == 84
    assert f"of {84} coordinates" in reduced_train.matrices.left_out
    values = []
    for train in (full_train, reduced_train):
        eigenvalues = np.linalg.eigvals(train.state_space().A)
        is_in_range = (eigenvalues.imag > math.tau * 50.0) & (abs(eigenvalues) < math.tau * 1250.0)
        values.append(np.sort_complex(1j * eigenvalues[is_in_range]))
    assert values[1] == pytest.approx(values[0], rel=1e-3)
    frequencies = np.linspace(50.0, 1250.0, 101)
    responses = [
        gearlib.frequency_response(
            train.state_space(inputs=["rotation of pinion"]), frequencies
        ).response_amplitude.values
        for train in (full_train, reduced_train)
    ]
    assert responses[1] == pytest.approx(responses[0], rel=1e-3)


def test_a_reduced_rotor_has_the_mesh_forces_of_the_full_one():
    """A train reduced for frequencies up to 4000 Hz must give the same largest mesh forces."""
    full_train = two_rotors()
    results = [
        gearlib.sweep(train, [0.02, 0.05], periods=200, record_periods=2).dynamic_force_max.values
        for train in (full_train, full_train.reduce(8000.0))
    ]
    assert results[1] == pytest.approx(results[0], rel=2e-3)


def test_a_planetary_train_given_by_its_own_matrices_has_the_same_motion():
    """A train rebuilt from its own matrices must have the motion of the original."""
    train = gearlib.planetary(stiffness_ratio=(0.7, 0.7))
    train_of_matrices = rebuild_from_matrices(train)
    options = {"periods": 20, "record_periods": 2, "samples_per_period": 16}
    runs = [
        gearlib.simulate(x, 0.9, **options).displacement.values for x in (train, train_of_matrices)
    ]
    assert runs[1] == pytest.approx(runs[0], abs=1e-11)


def test_studies_of_a_train_of_matrices_match_the_same_train_of_bodies():
    """All studies must give the same results for a train of bodies and its matrices."""
    trains = pair_of_bodies(stiffness_ratio=0.7), pair_of_matrices()
    orbits = [gearlib.periodic_orbit(train, 0.7) for train in trains]
    assert np.abs(orbits[1].multipliers) == pytest.approx(np.abs(orbits[0].multipliers), rel=1e-9)
    assert "Proven" in str(gearlib.certify(orbits[1]))
    branches = [gearlib.continue_orbit(orbit, to=0.72) for orbit in orbits]
    assert branches[1].tuning[-1] == pytest.approx(float(branches[0].tuning[-1]), rel=1e-9)
    arguments = {"parameters": ["max_stiffness", "load"], "tuning": 0.7, "periods": 5}
    sensitivities = [
        gearlib.sensitivities(gearlib.simulate, train, **arguments) for train in trains
    ]
    for name in sensitivities[0].data_vars:
        if "mesh" in sensitivities[0][name].dims and sensitivities[0][name].dtype.kind == "f":
            np.testing.assert_allclose(
                sensitivities[1][name], sensitivities[0][name], rtol=1e-6, atol=1e-9
            )
    runs = [gearlib.run_up(train, 5e3, 2e4, duration=0.01) for train in trains]
    np.testing.assert_allclose(runs[1].mean_force, runs[0].mean_force, rtol=1e-8)
    weakly_damped = {"material_damping": 300.0, "stiffness_ratio": 0.5}
    trains = [train.replace(meshes=[replace(train.meshes[0], **weakly_damped)]) for train in trains]
    zones = [gearlib.tongues(train, start=1.5, stop=2.5, step=0.01) for train in trains]
    for name in ("tuning_from", "tuning_to", "growth"):
        assert zones[1][name].values == pytest.approx(zones[0][name].values, abs=1e-8)


@pytest.mark.parametrize("method", ["exact", "scipy"])
def test_an_unsymmetric_structure_rests_in_its_static_state(method):
    """A circulatory part of the stiffness must not disturb the static state of constant meshes."""
    stiffness = ROSS_MATRICES["stiffness"].copy()
    stiffness[0, 1] += 3e7
    stiffness[1, 0] -= 3e7
    train = two_rotors(stiffness=stiffness, damping=2e-4 * ROSS_MATRICES["stiffness"]).reduce(
        1000.0
    )
    options = {"periods": 2, "record_periods": 2, "samples_per_period": 16}
    run = gearlib.simulate(train, 0.05, initial_state="static", method=method, **options)
    assert run.displacement.values == pytest.approx(1.0, abs=1e-7)


def test_a_harmonic_force_on_a_fixed_axis_is_refused():
    """A force along the fixed x axis of a body must be refused, because it could not move it."""
    force = HarmonicForce(body="a", amplitude=20.0, order=1, of="a", axis="x")
    with pytest.raises(ValueError, match="axis of a force on body a = 'x' is not allowed"):
        _ = pair_of_bodies(forces=[force])


def test_a_harmonic_force_acts_on_a_coordinate_of_matrices():
    """A torque given by body or by coordinate name must cause the same motion."""
    ripple = {"amplitude": 20.0, "order": 2, "of": "m", "phase": 0.4}
    trains = [
        pair_of_matrices(harmonic_forces=[HarmonicForce(body=name, **ripple)])
        for name in ("a", "angle a")
    ]
    runs = [gearlib.simulate(train, 0.6, periods=20).displacement.values for train in trains]
    assert np.array_equal(*runs)


def test_a_harmonic_torque_on_a_linear_pair_matches_the_closed_form():
    """The steady motion must be the static deflection plus the response k - m w^2 + i c w gives."""
    force = HarmonicForce(body="a", amplitude=20.0, order=2, of="m", phase=0.4)
    train = pair_of_bodies(forces=[force])
    result = gearlib.simulate(train, 0.6, periods=400, record_periods=1, samples_per_period=64)
    omega = 2.0 * float(result.mesh_frequency)
    # The displacement of the mesh is a single coordinate with this reduced mass.
    mass = 1.0 / (0.1**2 / 0.01 + 0.2**2 / 0.04)
    force_amplitude = 20.0 * 0.1 / 0.01 * mass
    static_deflection = 100.0 / 0.1 / 3e8
    response = force_amplitude / (3e8 - mass * omega**2 + 3000.0j * omega)
    phase = 2.0 * result.phase.values + 0.4
    expected = 1.0 + (response * np.exp(1j * phase)).real / static_deflection
    assert result.displacement.values.ravel() == pytest.approx(expected, rel=1e-9)


def test_modal_damping_matches_the_complex_eigenvalues():
    """The damping ratio must be c / (2 sqrt(k m)) of the single elastic mode."""
    modes = pair_of_bodies().modes()
    mass, stiffness, damping = 1.0 / (0.1**2 / 0.01 + 0.2**2 / 0.04), 3e8, 3000.0
    ratio = damping / 2.0 / math.sqrt(stiffness * mass)
    assert modes.modal_damping_ratio.values[-1] == pytest.approx(ratio, rel=1e-9)


def test_modal_damping_ratios_add_to_the_damping_of_the_meshes():
    """A modal damping ratio of 0.07 must add to the ratio that the mesh damping causes."""
    ratios = [
        train.modes().modal_damping_ratio.values[-1]
        for train in (pair_of_bodies(), pair_of_bodies(modal_damping=[0.07]))
    ]
    assert ratios[1] - ratios[0] == pytest.approx(0.07, rel=1e-9)


def test_a_step_response_of_the_state_space_ends_in_the_static_state():
    """The response to constant balanced torques must end at the static mesh force."""
    system = pair_of_bodies().state_space(
        inputs=["rotation of a", "rotation of b"],
        outputs=["mesh force of m", "acceleration rotation of a"],
    )
    assert isinstance(system, scipy.signal.StateSpace)
    assert system.input_names == ("rotation of a", "rotation of b")
    # Balanced torques cause no rigid-body acceleration, and the mesh carries 100 N m / 0.1 m.
    time = np.linspace(0.0, 0.5, 20001)
    torques = np.tile([100.0, 200.0], (time.size, 1))
    _, response, _ = scipy.signal.lsim(system, torques, time)
    assert response[-1] == pytest.approx([1000.0, 0.0], rel=1e-6, abs=1e-3)


def test_state_space_refuses_unknown_names_and_trains_without_bodies():
    """State spaces must refuse other models and unknown inputs or outputs."""
    with pytest.raises(ValueError, match="model of type GearPair is not allowed"):
        gearlib.state_space(gearlib.GearPair.from_ratios(contact_ratio=1.6, stiffness_ratio=0.7))
    with pytest.raises(ValueError, match="inputs = 'torque' is not allowed"):
        gearlib.state_space(pair_of_bodies(), inputs=["torque"])
    with pytest.raises(ValueError, match="outputs = 'force' is not allowed"):
        gearlib.state_space(pair_of_bodies(), outputs=["force"])
    with pytest.raises(ValueError, match="system = 1 is not allowed"):
        gearlib.frequency_response(1, [1.0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stiffness": np.eye(3)}, r"stiffness .*finite numbers with 84 rows"),
        ({"mass": -np.eye(84)}, "mass .*positive definite"),
        ({"gyroscopic": np.eye(84), "speed": 1.0}, "gyroscopic .*skew-symmetric"),
        ({"gyroscopic": np.zeros((84, 84))}, "speed .*given if and only if gyroscopic is"),
        ({"coordinates": ["x"] * 84}, "coordinates .*84 different names"),
        ({"forces": {"a 3 trun": 100.0}}, "forces .*a 3 trun"),
        ({"rows": {"pinion-wheel": [1.0]}}, "rows.*84 finite numbers"),
        ({"mass": "mass.txt"}, r"\.mtx"),
        ({"gears": ["pinion"]}, r"gears\[0\] = 'pinion' .*must be a GearNode"),
        ({"forces": [100.0, 200.0]}, "forces .*must be a dict"),
        ({"forces": {"a 3 turn": math.nan}}, "forces.*must be a finite number"),
        ({"stiffness": -ROSS_MATRICES["stiffness"]}, "stiffness .*no negative eigenvalue"),
        ({"reference": "gear"}, "reference = 'gear' is not allowed"),
        ({"forces": {"a 3 turn": 100.0}}, "no spring resists .*for example with 0 on a 3 turn"),
        (
            {"forces": {"a 3 turn": 100.0, "b 2 turn": 150.0}},
            "no spring resists .*for example with 200 on b 2 turn",
        ),
        (
            {"harmonic_forces": [HarmonicForce(body="a 0 x", amplitude=1.0, order=1, of="disk")]},
            "reference of a force = 'disk' is not allowed: it must be one of",
        ),
    ],
)
def test_wrong_matrices_are_refused_in_one_sentence(changes, message):
    """Each wrong argument must raise an error that names it and has a single line."""
    with pytest.raises(ValueError, match=message) as error:
        _ = two_rotors(**changes).static_deflection
    assert "\n" not in str(error.value)


def test_writing_a_train_without_its_matrices_is_refused(tmp_path):
    """A train of matrices must not be written, because a YAML file cannot hold them."""
    with pytest.raises(ValueError, match="train with given matrices cannot be written"):
        gearlib.write_train(pair_of_matrices(), tmp_path / "train.yaml")


def test_matrices_are_read_from_files_and_sparse_arrays(tmp_path):
    """Matrices from files and sparse arrays must give the same train as dense arrays."""
    from scipy import io, sparse

    arrays = {name: ROSS_MATRICES[name] for name in ("mass", "stiffness")}
    io.mmwrite(tmp_path / "mass.mtx", sparse.coo_array(arrays["mass"]))
    train = two_rotors(mass=tmp_path / "mass.mtx", stiffness=sparse.csr_array(arrays["stiffness"]))
    assert train == two_rotors()

"""The page about structures of other tools, with ROSS, OpenTorsion and python-control."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from gearlib.models.trains.statics import equilibrium
from tests.couple import ROSS_NATURAL_FREQUENCIES

PAGE = Path(__file__).resolve().parents[2] / "docs/how_to/coupling.md"
#: Arguments of ROSS's `MultiRotor` that join both rotors by the gear mesh of the page.
GEAR_COUPLING = {"coupled_nodes": (3, 2), "gear_mesh_stiffness": 2e8, "position": "below"}


@pytest.fixture(scope="module")
def page_variables(tmp_path_factory):
    """Run the code blocks of the page, check their printed output and return their variables."""
    for module in ("ross", "opentorsion", "control"):
        pytest.importorskip(module, reason="the extra `couple` is missing")
    page_variables, printed = {}, []
    page_variables["print"] = lambda *values: printed.append(" ".join(map(str, values)) + "\n")
    # A code block may be followed by a block of type "text" with its output.
    pattern = r"^``` ?python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?"
    blocks = re.findall(pattern, PAGE.read_text(encoding="utf-8"), re.S | re.M)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("page"))
        for code, expected_output in blocks:
            printed.clear()
            exec(compile(code, PAGE.name, "exec"), page_variables)
            assert "".join(printed) == expected_output
            # The first block makes the train of two rotors; a later one reassigns `train`.
            page_variables.setdefault("rotor_train", page_variables["train"])
    return page_variables


def natural_frequencies(stiffness, mass):
    """Return the natural frequencies, Hz, for a stiffness and a mass matrix in SI units."""
    squared_angular_frequencies = scipy.linalg.eigvalsh(stiffness, mass)
    # Rounding may make the zero eigenvalues of rigid-body modes negative.
    return np.sqrt(np.maximum(squared_angular_frequencies, 0.0)) / (2.0 * np.pi)


def test_natural_frequencies_of_two_rotors_match_ross(page_variables):
    """Natural frequencies must equal stored and newly computed ones of ROSS's `MultiRotor`."""
    # The first three modes are rigid-body modes with zero frequency.
    frequencies = page_variables["rotor_train"].modes().natural_frequency.values[3:]
    # The stored frequencies have seven digits.
    stored = ROSS_NATURAL_FREQUENCIES
    assert frequencies[: len(stored)] == pytest.approx(stored, rel=1e-6)
    joined = page_variables["ross"].MultiRotor(
        page_variables["a"], page_variables["b"], **GEAR_COUPLING
    )
    expected = natural_frequencies(joined.K(0), joined.M(0))[3:]
    assert frequencies == pytest.approx(expected, rel=1e-8)


def test_whirl_frequencies_of_two_rotors_match_ross(page_variables):
    """Damped frequencies with gyroscopic forces at 500 rad/s must equal those of `MultiRotor`."""
    modes = page_variables["rotor_train"].replace(modal_damping=None).modes()
    joined = page_variables["ross"].MultiRotor(
        page_variables["a"], page_variables["b"], **GEAR_COUPLING
    )
    expected = joined.run_modal(speed=500.0, num_modes=30).wd / (2.0 * np.pi)
    frequencies = modes.damped_frequency.values
    # ROSS omits the rigid-body modes, whose frequencies are below 1 Hz.
    frequencies = frequencies[frequencies > 1.0][: expected.size]
    assert frequencies == pytest.approx(expected, rel=1e-6)


def test_natural_frequencies_of_a_drivetrain_match_opentorsion(page_variables):
    """Frequencies must equal those of OpenTorsion's matrices plus mesh and of its elastic gears."""
    from opentorsion import Assembly, ElasticGear

    mesh_stiffness, wheel_radius, pinion_radius = 2e9, 0.4, 0.1
    tool, modes = page_variables["tool"], page_variables["drivetrain"].modes()
    # The first mode is the rigid-body rotation.
    elastic_frequencies = modes.natural_frequency.values[1:]
    # The mesh deflection is the product of these lever arms and the rotations of the five nodes.
    lever_arms = np.array([0.0, 0.0, wheel_radius, pinion_radius, 0.0])
    stiffness = tool.K + mesh_stiffness * np.outer(lever_arms, lever_arms)
    expected = natural_frequencies(stiffness, tool.M)[1:]
    assert elastic_frequencies == pytest.approx(expected, rel=1e-9)
    wheel = ElasticGear(2, 50.0, wheel_radius)
    # OpenTorsion refers the mesh stiffness to the rotation of the wheel.
    rotational_stiffness = mesh_stiffness * wheel_radius**2
    pinion = ElasticGear(3, 1.0, pinion_radius, k=rotational_stiffness, c=0.0, parent=wheel)
    gears = [wheel, pinion]
    disks = [page_variables["disks"][node] for node in (0, 1, 4)]
    joined = Assembly(page_variables["shafts"], disk_elements=disks, elastic_gear_elements=gears)
    squared_angular_frequencies = np.sort(joined.undamped_modal_analysis()[0].real)
    expected = np.sqrt(squared_angular_frequencies[1:]) / (2.0 * np.pi)
    assert elastic_frequencies == pytest.approx(expected, rel=1e-9)


def test_static_displacement_follows_the_stiffness_profile(page_variables):
    """The static mesh deflection must be the load divided by the mesh stiffness at each phase."""
    # Load, mean stiffness and stiffness amplitude are those of the page.
    train, load, mean_stiffness, amplitude = page_variables["train"], 2000.0, 3e8, 6e7
    for phase in (0.0, 1.0, 2.0, 3.0):
        deflection = train.structure.mesh_jacobian[0] @ equilibrium(train, phase).q
        stiffness = mean_stiffness + amplitude * np.cos(phase)
        assert deflection == pytest.approx(load / stiffness, rel=1e-9)


def test_frequency_response_matches_python_control(page_variables):
    """Response amplitudes to the first input must equal the transfer functions of that package."""
    import control

    system, response = page_variables["system"], page_variables["response"]
    plant = control.ss(system.A, system.B, system.C, system.D)
    transfer_functions = plant(2j * np.pi * response.frequency.values)
    amplitudes = np.abs(transfer_functions)[:, 0].T
    assert amplitudes == pytest.approx(response.response_amplitude.values[..., 0], rel=1e-9)

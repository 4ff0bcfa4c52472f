"""The page about structures of other tools, with ROSS, OpenTorsion and python-control."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from gearlib.models.trains.statics import equilibrium
from tests.couple import OF_ROSS

PAGE = Path(__file__).resolve().parents[2] / "docs/how_to/coupling.md"


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """Run the code blocks of the page, check what they print, and return their names."""
    for module in ("ross", "opentorsion", "control"):
        pytest.importorskip(module, reason="the extra `couple` is missing")
    names, printed = {}, []
    names["print"] = lambda *values: printed.append(" ".join(map(str, values)) + "\n")
    pattern = r"^``` ?python\n(.*?)^```(?:\n\n```text\n(.*?)^```)?"
    blocks = re.findall(pattern, PAGE.read_text(encoding="utf-8"), re.S | re.M)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("page"))
        for code, shown in blocks:
            del printed[:]
            exec(compile(code, PAGE.name, "exec"), names)
            assert "".join(printed) == shown
            # A later block gives another value to `train`.
            names.setdefault("of_ross", names["train"])
    return names


def frequencies(stiffness, mass):
    """Return the natural frequencies of matrices in Hz."""
    return np.sqrt(np.maximum(scipy.linalg.eigvalsh(stiffness, mass), 0.0)) / (2.0 * np.pi)


def test_natural_frequencies_of_two_rotors_match_ross(names):
    modes = names["of_ross"].modes()
    assert modes.natural_frequency.values[3:14] == pytest.approx(OF_ROSS, rel=1e-6)
    joined = names["ross"].MultiRotor(
        names["a"], names["b"], coupled_nodes=(3, 2), gear_mesh_stiffness=2e8, position="below"
    )
    expected = frequencies(joined.K(0), joined.M(0))[3:]
    assert modes.natural_frequency.values[3:] == pytest.approx(expected, rel=1e-8)


def test_whirl_frequencies_of_two_rotors_match_ross(names):
    modes = names["of_ross"].replace(modal_damping=None).modes()
    joined = names["ross"].MultiRotor(
        names["a"], names["b"], coupled_nodes=(3, 2), gear_mesh_stiffness=2e8, position="below"
    )
    expected = joined.run_modal(speed=500.0, num_modes=30).wd / (2.0 * np.pi)
    damped_frequencies = modes.damped_frequency.values
    assert damped_frequencies[damped_frequencies > 1.0][: expected.size] == pytest.approx(
        expected, rel=1e-6
    )


def test_natural_frequencies_of_a_drivetrain_match_opentorsion(names):
    """Compare with opentorsion, by its matrices and by its own elastic gears."""
    from opentorsion import Assembly, ElasticGear

    tool, natural_frequencies = names["tool"], names["drivetrain"].modes().natural_frequency.values
    row = np.array([0.0, 0.0, 0.4, 0.1, 0.0])
    expected = frequencies(tool.K + 2e9 * np.outer(row, row), tool.M)
    assert natural_frequencies[1:] == pytest.approx(expected[1:], rel=1e-9)
    wheel = ElasticGear(2, 50.0, 0.4)
    pinion = ElasticGear(3, 1.0, 0.1, k=2e9 * 0.4**2, c=0.0, parent=wheel)
    disks = [names["disks"][node] for node in (0, 1, 4)]
    gears = [wheel, pinion]
    joined = Assembly(names["shafts"], disk_elements=disks, elastic_gear_elements=gears)
    squares = np.sort(joined.undamped_modal_analysis()[0].real)
    assert natural_frequencies[1:] == pytest.approx(np.sqrt(squares[1:]) / (2.0 * np.pi), rel=1e-9)


def test_static_displacement_follows_the_stiffness_profile(names):
    train = names["train"]
    for phase in (0.0, 1.0, 2.0, 3.0):
        approach = train.structure.lines[0] @ equilibrium(train, phase).q
        assert approach == pytest.approx(2000.0 / (3e8 + 6e7 * np.cos(phase)), rel=1e-9)


def test_frequency_response_matches_python_control(names):
    import control

    system, response = names["system"], names["response"]
    plant = control.ss(system.A, system.B, system.C, system.D)
    amplitudes = np.abs(plant(2j * np.pi * response.frequency.values))[:, 0].T
    assert amplitudes == pytest.approx(response.response_amplitude.values[..., 0], rel=1e-9)

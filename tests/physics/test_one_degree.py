"""Nonlinear damping, stiffness and excitation: limits, other laws in closed form, tables."""

import math

import numpy as np
import pytest

from gearlib import Fourier, Harmonics, OneDegreePair, Tabulated, simulate, sweep
from tests.paper import PAPER

LINEAR = PAPER.replace(material_damping=1000.0, backlash_damping=300.0)
UNDAMPED = LINEAR.replace(material_damping=0.0, backlash_damping=0.0)
QUADRATIC = {"quadratic_damping": 3e4, "backlash_quadratic_damping": 2e4}
CUBIC = {"cubic_damping": 4e5, "backlash_cubic_damping": 2e5}
TABLE = Tabulated((0.1, 1.0, 2.5, 4.0, 5.5), (4e8, 3.1e8, 2.4e8, 2.6e8, 3.7e8))


@pytest.mark.parametrize("nu", [0.5, 0.7, 0.82, 0.9, 1.5])
def test_linear_damping_equals_the_exact_propagator(nu):
    # Both are at rounding: 40 periods of it, damped.
    runs = [
        simulate(LINEAR, nu, periods=40, record_periods=4, method=method)
        for method in ("exact", "taylor")
    ]
    for name in ("displacement", "velocity", "acceleration", "dynamic_force", "event_phase"):
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=0, atol=1e-11, err_msg=name)
    for name in ("displacement_max", "displacement_min", "fraction_min_stiffness", "bounces"):
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=0, atol=1e-11, err_msg=name)


@pytest.mark.parametrize("nu", [0.5, 0.7, 0.8, 0.9, 1.5])
@pytest.mark.parametrize(
    "model",
    [
        OneDegreePair(pair=LINEAR, excitation=Harmonics((500.0, 200.0), (-800.0,))),
        OneDegreePair(pair=LINEAR, deviation=Harmonics((3e-6,), (1e-6, 1e-6))),
        OneDegreePair(pair=LINEAR.replace(backlash=12e-6), excitation=Harmonics((0.0, 4000.0))),
        OneDegreePair(pair=LINEAR.replace(backlash=float("inf")), deviation=Harmonics((3e-6,))),
    ],
)
def test_harmonic_excitation_stays_in_closed_form(model, nu):
    options = {"periods": 20, "record_periods": 20, "samples_per_period": 64}
    exact = simulate(model, nu, **options)
    assert exact.attrs["source"].endswith("method exact")
    taylor = simulate(model, nu, method="taylor", **options)
    assert exact.event_to.values.tolist() == taylor.event_to.values.tolist()
    # Rounding of two ways through 20 periods, some of them chaotic at first.
    for name in ("displacement", "velocity", "acceleration", "dynamic_force", "event_phase"):
        np.testing.assert_allclose(exact[name], taylor[name], rtol=0, atol=1e-8, err_msg=name)
    for name in ("displacement_max", "dynamic_force_min", "fraction_min_stiffness", "bounces"):
        np.testing.assert_allclose(exact[name], taylor[name], rtol=0, atol=1e-8, err_msg=name)
    table = sweep(model, [nu], periods=20, record_periods=20)
    np.testing.assert_allclose(table.displacement_max, [exact.displacement_max], atol=1e-10)


def test_more_harmonics_come_closer_to_the_rectangle():
    exact = simulate(LINEAR, 0.7, periods=60)
    errors = []
    for n in (4, 16, 64):
        run = simulate(OneDegreePair(pair=LINEAR, profile=Fourier(n)), 0.7, periods=60)
        errors.append(float(abs(run.displacement - exact.displacement).max()))
    assert errors[0] > 4 * errors[1] > 16 * errors[2]


def test_a_rectangle_as_a_table():
    # A table cannot jump; a step of 1e-7 rad is as good to a few parts in 1e7.
    half, d = math.pi * 0.569, 1e-7
    phase = (0.0, half, half + d, 2 * math.pi - half - d, 2 * math.pi - half)
    table = Tabulated(phase, (4e8, 4e8, 0.5879 * 4e8, 0.5879 * 4e8, 4e8))
    c_max, kappa, epsilon = table.ratios()
    assert (c_max, kappa) == (4e8, pytest.approx(0.5879)) and epsilon == pytest.approx(1.569)
    run = simulate(OneDegreePair(pair=LINEAR, profile=table), 0.9, periods=20)
    exact = simulate(LINEAR, 0.9, periods=20)
    np.testing.assert_allclose(run.displacement, exact.displacement, atol=1e-5)
    assert float(run.fraction_min_stiffness) == pytest.approx(
        float(exact.fraction_min_stiffness), abs=1e-6
    )


def test_tables_are_read(tmp_path):
    path = tmp_path / "table.csv"
    rows = zip(TABLE.phase, TABLE.stiffness, strict=True)
    path.write_text("phase,stiffness\n" + "".join(f"{p},{c}\n" for p, c in rows), encoding="utf-8")
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match="no column 'C'"):
        Tabulated.read(path, stiffness="C")


def test_harmonics_of_a_table():
    given = Harmonics((1.0, -0.5), (0.25, 0.0))
    phase = 0.3 + 2 * math.pi * np.arange(16) / 16
    n, a, b = given.table().T[:, :, None]
    values = (a * np.cos(n * phase) + b * np.sin(n * phase)).sum(0)
    found = Harmonics.from_table(phase, values, 2)
    np.testing.assert_allclose(found.table(), given.table(), atol=1e-15)


def test_sweep_equals_single_runs():
    model = OneDegreePair(pair=UNDAMPED, **CUBIC)
    options = {"periods": 40, "record_periods": 4}
    table = sweep(model, [0.9, 0.7], **options)
    for nu in (0.7, 0.9):
        one = simulate(model, nu, **options)
        for name in ("displacement_max", "dynamic_force_min", "period", "final_state"):
            np.testing.assert_array_equal(table[name].sel(tuning=nu), one[name])


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (lambda: OneDegreePair(pair=LINEAR, cubic_damping=-1.0), "cubic_damping = -1.0"),
        (lambda: OneDegreePair(pair=LINEAR, cubic_stiffness=math.nan), "cubic_stiffness = nan"),
        (lambda: OneDegreePair(pair=1), "pair = 1"),
        (lambda: OneDegreePair(pair=LINEAR, profile=3), "profile = 3"),
        (lambda: Fourier(0), "harmonics = 0"),
        (lambda: Tabulated((0.0, 7.0), (1.0, 2.0)), "rise strictly"),
        (lambda: Tabulated((0.0, 1.0), (1.0, -2.0)), "stiffness[1] = -2.0"),
        (lambda: Harmonics((math.inf,)), "cosines[0] = inf"),
        (
            lambda: simulate(OneDegreePair(pair=LINEAR, **CUBIC), 0.8, periods=1, method="exact"),
            "method = 'exact'",
        ),
        (lambda: simulate(3, 0.8, periods=1), "pair = 3"),
    ],
)
def test_wrong_input(call, part):
    with pytest.raises(ValueError) as error:
        call()
    assert part in str(error.value) and "must" in str(error.value)

"""Figures: structure, limits and bytes; the pictures themselves are looked at by people."""

import math

import numpy as np
import pytest

from gearlib import GearPair, phase_lag, scenes, simulate, sweep
from gearlib.figures import phase_planes, phase_shift, resonance, style, time_courses
from gearlib.gathering import gather_phase_planes, gather_resonance

RUN = {"periods": 40, "record_periods": 8}


def pairs(backlash=4.0):
    ratios = {"contact_ratio": 1.5, "stiffness_ratio": 0.6, "backlash": backlash}
    return {
        "k1": GearPair.from_ratios(**ratios, damping=0.06),
        "my own+oil": GearPair.from_ratios(**ratios, damping=0.06, backlash_damping=0.1),
        "conservative": GearPair.from_ratios(**ratios),
    }


def curves(tunings, directions=("cold", "up", "down"), backlash=4.0):
    return gather_resonance(
        [
            sweep(pair, tunings, direction=d, **RUN).assign_coords(damping=name, direction=d)
            for name, pair in pairs(backlash).items()
            for d in directions
        ]
    )


def planes(tunings, backlash=4.0):
    return gather_phase_planes(
        [
            simulate(pair, nu, samples_per_period=16, **RUN).assign_coords(damping=name)
            for name, pair in pairs(backlash).items()
            for nu in tunings
        ]
    )


GRID = np.linspace(0.6, 1.2, 31)


def test_resonance_has_scales_units_and_every_curve():
    figure = resonance.draw(curves(GRID))
    main, *panels = figure.axes
    assert main.get_xlabel() == "tuning $\\nu_s$" and "static deflections" in main.get_ylabel()
    labels = [axis.get_xlabel() for axis in main.child_axes]
    assert "tuning $\\nu_\\mathrm{max}$" in labels and "tuning $\\nu_\\mathrm{min}$" in labels
    assert [axis.get_ylabel() for axis in main.child_axes][-1].endswith("(m)")
    names = [text.get_text() for text in main.get_legend().get_texts()]
    assert names == ["$k_{1}$", "my own + oil", "conservative"]
    assert len(panels) == 3
    low, high = main.get_xlim()
    assert low < 0.6 and high > 1.2


@pytest.mark.parametrize("backlash", [math.inf, 0.0, 0.5])
def test_any_backlash(backlash):
    figure = resonance.draw(curves(GRID, backlash=backlash))
    assert np.isfinite(figure.axes[0].get_ylim()).all()
    assert np.isfinite(phase_planes.draw(planes([0.8], backlash)).axes[0].get_xlim()).all()


def test_runs_that_could_not_go_on_are_left_out():
    data = curves(GRID)
    data.displacement_max[0] = data.displacement_min[0] = np.nan
    data.period[0] = 0
    assert np.isfinite(resonance.draw(data).axes[0].get_ylim()).all()
    data = planes([0.7, 0.9])
    data.displacement[0, 0] = np.nan
    labels = [text.get_text() for text in phase_planes.draw(data).axes[0].texts]
    assert labels == ["no result"]


def test_a_single_direction_and_a_single_tuning():
    assert len(resonance.draw(curves(GRID, directions=("up",))).axes) == 1
    resonance.draw(curves([0.8]))


def test_phase_planes_are_a_labelled_grid():
    figure = phase_planes.draw(planes([0.7, 0.9]))
    grid = np.reshape(figure.axes, (2, 3))
    assert [axes.get_title() for axes in grid[0]] == ["$k_{1}$", "my own + oil", "conservative"]
    assert all("static defl." in axes.get_xlabel() for axes in grid[1])
    assert all("dy/d\\tau" in axes.get_ylabel() for axes in grid[:, 0])
    for row in grid:
        assert len({axes.get_xlim() for axes in row}) == 1
        assert len({axes.get_ylim() for axes in row}) == 1
    assert grid[0, 0].texts[0].get_text() == "steady, 1 mesh period"
    assert grid[0, 2].texts[0].get_text() == "unsteady"


def test_time_courses_have_a_column_for_each_case():
    pair = {
        "max_stiffness": 4e8,
        "stiffness_ratio": 0.6,
        "contact_ratio": 1.5,
        "reduced_mass": 3.0,
        "load": 3000.0,
        "backlash": math.inf,
    }
    cases = [{"title": f"case {nu}", "tuning": nu, "pair": pair} for nu in (0.7, 0.9)]
    scene = scenes.compute(cases, "one_degree", {}, RUN | {"samples_per_period": 32})
    courses = ["displacement", "modified_stiffness"]
    figure = time_courses.draw(scene, courses=courses, periods_shown=2)
    grid = np.reshape(figure.axes, (3, 2))
    assert [axes.get_title() for axes in grid[0]] == ["case 0.7", "case 0.9"]
    assert [axes.get_ylabel() for axes in grid[1:, 0]] == ["$y$", "$C(H_1+H_2)/C_s$"]
    for axes in grid[1:].flat:
        low, high = axes.get_xlim()
        assert low == pytest.approx(6.0) and high == pytest.approx(8.0 - 1 / 32)
    assert all(axes.get_xlabel() == "mesh periods" for axes in grid[-1])


def test_phase_lag_of_a_mesh_without_resonance():
    # Slowly, in contact and with small stiffness swings, y follows F / C at once: 180 degrees
    # against the stiffness, and damping adds the lag of a first-order system.
    pair = {
        "max_stiffness": 4e8,
        "stiffness_ratio": 0.99,
        "contact_ratio": 1.5,
        "reduced_mass": 3.0,
        "load": 3000.0,
        "backlash": math.inf,
    }
    options = {"harmonics": 1, "periods": 60, "samples_per_period": 4096}
    damping = 2.0 * 0.5 * math.sqrt(3.0 * 3.98e8)
    lags = phase_lag.compute(pair, [damping], 0.05, [0.05, 0.1], **options)
    for nu, lag in zip((0.05, 0.1), lags.first_lag.values[0], strict=True):
        # Transfer function of the mean oscillator, beta = 0.5; the swing is 1 % of it.
        expected = 180.0 + math.degrees(math.atan2(nu, 1.0 - nu * nu))
        assert lag == pytest.approx(expected, abs=0.1)
    figure = phase_shift.draw(lags)
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "",
        "mesh periods",
        "harmonic of the mesh period",
        "tuning $\\nu_s$",
    ]


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_same_data_same_bytes(suffix, tmp_path):
    data = planes([0.8])
    for name in ("a", "b"):
        style.save(phase_planes.draw(data), tmp_path / f"{name}.{suffix}")
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


def test_unknown_format_is_refused(tmp_path):
    with pytest.raises(ValueError, match="must end in"):
        style.save(phase_planes.draw(planes([0.8])), tmp_path / "figure.tiff")

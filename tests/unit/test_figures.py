"""Figures: structure, limits and bytes; the pictures themselves are looked at by people."""

import math

import numpy as np
import pytest

from gearlib import GearPair, simulate, sweep
from gearlib.data.gathering import gather_phase_planes, gather_resonance
from gearlib.figures import (
    jump,
    models,
    nonlinear_damping,
    phase_planes,
    phase_shift,
    resonance,
    style,
    time_courses,
)
from gearlib.studies import jump as jump_study
from gearlib.studies import model_comparison as comparison
from gearlib.studies import nonlinear_damping as damping_study
from gearlib.studies import phase_lag, scenes
from tests.paper import PARAMETERS

RUN = {"periods": 40, "record_periods": 8}
STARTS = {"starts": 4, "seed": 1, "spread": 0.02}


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
    scene = scenes.compute(cases, "one_degree", {}, RUN | {"samples_per_period": 32}, STARTS)
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


KINDS = {
    "harmonics": [1, 5],
    "factors": [0.5, 0.9],
    "displacements": [-0.1, 0.1],
    "velocities": [0.1],
    "tolerances": [1e-3, 1e-6],
}


def jumps(low=0.80, high=0.83, **kinds):
    settings = {"resolution": 1e-4, **dict.fromkeys(KINDS, []), **kinds}
    run = {"periods": 60, "record_periods": 8}
    pair = PARAMETERS | {"material_damping": 3953.7}
    return jump_study.compute(pair, np.linspace(low, high, 7), settings, run)


def studies(powers=damping_study.POWERS, backlash=PARAMETERS["backlash"]):
    settings = {"damping": 3953.7, "amplitude": 1.0, "tuning": 0.8, "shown": [0.78, 0.95]}
    pair = PARAMETERS | {"backlash": backlash}
    tunings = np.linspace(0.7, 1.0, 7)
    return [
        damping_study.compute(pair, place, power, tunings, settings, RUN, 32)
        for place in damping_study.PLACES
        for power in powers
    ]


def comparisons(tolerance=0.05):
    six = {
        "base_radii": [0.1, 0.1],
        "inertias": [0.097852, 0.097852],
        "masses": [17.27, 17.27],
        "bearing_stiffness": [1e7] * 4,
        "bearing_damping": [525.7] * 4,
        "eccentricities": [8e-6, 8e-6],
        "friction": [0.05, 0.05],
    }
    cases = [{"title": "one", "tuning": 0.82, "pair": PARAMETERS | {"material_damping": 3953.7}}]
    asked = {"observables": ["displacement_max"], "candidates": list(comparison.LADDER)}
    asked["tolerance"] = tolerance
    return {
        name: comparison.compute(cases, asked, six, 5, RUN, STARTS) for name in ("first", "second")
    }


def bars():
    data = comparisons()
    return [*data.values()], [*data]


def words_of(axes):
    return " ".join(
        [axes.get_title(), axes.get_title(loc="left"), *(t.get_text() for t in axes.texts)]
    )


def test_jump_has_a_panel_for_each_kind():
    figure = jump.draw(jumps(**KINDS))
    scan, *panels = figure.axes
    assert "static defl." in scan.get_ylabel() and scan.get_xlabel() == "tuning $\\nu_s$"
    assert "jumps at" in scan.get_title()
    labels = [axes.get_xlabel() for axes in panels]
    assert labels == [
        "stiffness harmonics",
        "relative tolerance of a 4(5) pair",
        "factor on the damping",
        "factor on the backlash",
        "initial displacement (static defl.)",
        "initial velocity (static defl./rad)",
    ]
    assert all(axes.get_ylabel() == "shift of the jump\n(tuning)" for axes in panels[::2])
    assert len({axes.get_ylim() for axes in panels}) == 1


def test_marked_tunings_of_the_jump():
    data = jumps(factors=[0.9])
    assert "dashed" not in jump.draw(data).axes[0].get_title()
    assert len(jump.draw(data).axes[1].patches) == 0
    scan, panel, _ = jump.draw(data, [0.82, 0.81]).axes
    assert scan.get_title().endswith("(dashed: 0.8200 and 0.8100)")
    (band,) = panel.patches
    ends = [band.get_y(), band.get_y() + band.get_height()]
    assert ends == pytest.approx([0.81, 0.82] - data.jump.values[0])


def test_a_single_kind_of_jump():
    figure = jump.draw(jumps(displacements=[0.1, 0.5]))
    assert [axes.get_xlabel() for axes in figure.axes[1:]] == [
        "initial displacement (static defl.)"
    ]
    assert len(jump.draw(jumps()).axes) == 1


def test_variations_without_a_jump_are_named_above_the_panel():
    # Twice the damping closes the jump of this scan.
    data = jumps(factors=[0.9, 2.0])
    assert np.isnan(data.jump.values).any()
    _, damping, backlash = jump.draw(data).axes
    assert words_of(damping).strip() == "no jump in the scan: 2"
    assert words_of(backlash).strip() == "" and not damping.texts
    # No line leads from a value to another: the jump in between is not known.
    assert all(
        line.get_linestyle() == "None" for line in damping.lines if len(line.get_xdata()) > 2
    )


def test_a_scan_without_any_jump():
    data = jumps(0.70, 0.76, factors=[0.9, 1.1])
    assert np.isnan(data.jump.values).all()
    scan, *panels = jump.draw(data).axes
    assert "does not jump" in scan.get_title() and "paper" not in scan.get_title()
    assert all(np.isfinite(axes.get_ylim()).all() for axes in panels)
    assert all("0.9, 1.1" in words_of(axes) for axes in panels)


def test_nonlinear_damping_has_a_column_for_each_place():
    figure = nonlinear_damping.draw(studies())
    grid = np.reshape(figure.axes, (3, 2))
    assert [axes.get_title() for axes in grid[0]] == [
        "damping of the material only",
        "damping of the oil only",
    ]
    assert "static defl." in grid[0, 0].get_ylabel()
    assert all("static defl./rad" in axes.get_ylabel() for axes in grid[1:, 0])
    assert all("static defl." in axes.get_xlabel() for axes in grid[1:].flat)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*damping_study.POWERS]


def test_characteristics_of_all_places_are_within_common_limits():
    data = studies(["linear"])
    # A column that is drawn later must not cut the curves of an earlier one.
    data[0].displacement_max[:] = 9.0
    above, beside, *_ = nonlinear_damping.draw(data).axes
    assert above.get_ylim() == beside.get_ylim() and above.get_ylim()[1] > 9.0


def test_a_single_power_without_results():
    data = studies(["cubic"], math.inf)
    for study in data:
        for name in ("displacement_max", "displacement_min", "displacement", "velocity"):
            study[name][:] = np.nan
    for axes in nonlinear_damping.draw(data).axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_steady_orbits_are_drawn_once():
    study = studies(["linear"])[0].sel(shown=0.95)
    whole = study.phase.size
    steady = study.assign(
        displacement=("phase", np.cos(study.phase.values)),
        velocity=("phase", -np.sin(study.phase.values)),
    )
    orbit = nonlinear_damping._orbit(steady)
    assert orbit.shape == (2, 32 + 1)
    assert orbit[:, 0] == pytest.approx(orbit[:, -1], abs=1e-9)
    growing = steady.assign(displacement=steady.displacement * np.linspace(1.0, 2.0, whole))
    assert nonlinear_damping._orbit(growing).shape == (2, whole)


def test_models_are_bars_with_their_cost():
    data = comparisons()
    figure = models.draw([*data.values()], [*data])
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "first: displacement_max",
        "second: displacement_max",
    ]
    for axes in figure.axes:
        names = [label.get_text() for label in axes.get_yticklabels()]
        assert names[0] == "1 degree" and names[-1] == "1 degree, 5 harmonics"
        words = [text.get_text() for text in axes.texts]
        assert len(words) == 4 and all("cost" in text for text in words)
        assert sum("carries the scene" in text for text in words) == 1
        assert "largest model" in words[2]
    label = figure.axes[-1].get_xlabel()
    assert "share of the height" in label and "per mesh period" in label


def test_words_on_bars_stay_in_the_panel():
    data = comparisons()
    data["first"].change[:] = [1e-9, 5.0, np.nan, 1e4]
    figure = models.draw([*data.values()], [*data])
    figure.draw_without_rendering()
    axes = figure.axes[0]
    frame = axes.get_window_extent()
    for text in axes.texts:
        box = text.get_window_extent()
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1


@pytest.mark.parametrize(
    ("draw", "computed"),
    [
        (jump.draw, lambda: (jumps(factors=[0.9, 2.0]),)),
        (nonlinear_damping.draw, lambda: (studies(["linear", "cubic"]),)),
        (models.draw, bars),
    ],
    ids=["jump", "nonlinear_damping", "models"],
)
def test_studies_same_data_same_bytes(draw, computed, tmp_path):
    data = computed()
    # As text every number of an artist is in the file; all formats are looked at below.
    for name in ("a", "b"):
        style.save(draw(*data), tmp_path / f"{name}.svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


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

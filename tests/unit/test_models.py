"""Models and runs: the border to SI, copies, speeds, torques, units, words for motions, limits."""

import dataclasses
import math
import re

import numpy as np
import pytest

import gearlib
from gearlib import GearPair, Harmonics, OneDegreePair, SixDegreePair, Tabulated, simulate, sweep
from gearlib.data.motions import describe_motion, mask_unbounded
from gearlib.models.model import Model
from gearlib.models.profiles import Steps
from tests.paper import PAPER_PAIR
from tests.properties.changes import in_units, unit_factor
from tests.properties.known_models import TABLE, pairs_as_train
from tests.sentences import assert_sentence

ONE = OneDegreePair(pair=PAPER_PAIR, cubic_damping=4e5, deviation=Harmonics((1e-6,)))
BODIES = {"base_radii": (0.1, 0.08), "inertias": (0.06, 0.05), "masses": (17.0, 12.0)}
BEARINGS = {"bearing_stiffness": (1e8,) * 4}
SIX = SixDegreePair(pair=PAPER_PAIR, deviation=Harmonics((1e-6,)), **BODIES, **BEARINGS)
OSCILLATOR = gearlib.DeadZoneOscillator(lower_edge=-1.0, upper_stiffness=2.0, damping=0.1)
UNEQUAL, TRAIN = SIX.replace(teeth=(30, 24)), gearlib.split_power_reducer(PAPER_PAIR)
RUN, SPAN = {"periods": 4, "samples_per_period": 8}, {"periods": 60, "record_periods": 4}
#: Damped in contact and in free flight.
PAIR = GearPair.from_ratios(
    contact_ratio=1.569,
    stiffness_ratio=0.5879,
    damping=0.0617,
    backlash_damping=0.0617,
    backlash_ratio=4,
)


@pytest.mark.parametrize("model", [ONE, SIX])
def test_a_model_takes_scales_and_ratios_from_its_pair(model):
    """Attributes that a model takes over from its gear pair must have the values of the pair."""
    # Models lack some attributes of a pair and define others themselves.
    excepted = {"from_geometry", "from_ratios", "RATIOS", "ratio_slopes"}
    excepted |= {*vars(Model), *vars(model)}
    names = {name for name in dir(PAPER_PAIR) if not name.startswith("_")}
    for name in (names - excepted) | {"speed_scales"}:
        value, expected = getattr(model, name), getattr(PAPER_PAIR, name)
        if callable(value):
            value, expected = value(0.8), expected(0.8)
        assert value == expected, name
    # Models with base radii also have a scale of torque.
    assert PAPER_PAIR.scales().items() <= model.scales().items()
    assert not hasattr(model, "from_ratios")


@pytest.mark.parametrize("model", [PAPER_PAIR, ONE, SIX, OSCILLATOR])
def test_a_copy_is_a_model_of_the_same_kind(model):
    """Replacing a field by its own value must give an equal model; unknown fields are refused."""
    for name in {field.name for field in dataclasses.fields(model)} - {"pair"}:
        assert model.replace(**{name: getattr(model, name)}) == model
    with pytest.raises(ValueError, match="stiffness_raito is not allowed: .* are .*stiffness"):
        model.replace(stiffness_raito=0.5)


@pytest.mark.parametrize("model", [ONE, SIX])
def test_a_copy_changes_the_model_or_its_pair(model):
    """Fields of the pair are changed in the pair, all other fields in the model itself."""
    changed = model.replace(backlash=20e-6, deviation=Harmonics((2e-6,)))
    assert type(changed) is type(model) and changed.deviation == Harmonics((2e-6,))
    assert changed.pair == PAPER_PAIR.replace(backlash=20e-6)
    pair = PAPER_PAIR.replace(contact_ratio=1.4)
    assert model.replace(pair=pair, backlash=math.inf).pair == pair.replace(backlash=math.inf)
    for changes, words in (({"backlash": -1}, "backlash = -1"), ({"pair": 3}, "pair = 3")):
        with pytest.raises(ValueError, match=words):
            model.replace(**changes)


def test_a_copy_computes_derived_defaults_anew_and_keeps_explicit_values():
    """Torques, teeth, coast deviation and dampings have defaults that follow from other fields."""
    heavier = SIX.replace(load=2.0 * PAPER_PAIR.load)
    assert heavier.torques == tuple(2.0 * torque for torque in SIX.torques)
    assert SIX.replace(base_radii=(0.2, 0.1)).torques == (
        0.2 * PAPER_PAIR.load,
        0.1 * PAPER_PAIR.load,
    )
    assert SIX.replace(deviation=Harmonics((2e-6,))).coast_deviation == Harmonics((2e-6,))
    assert SIX.teeth == (24, 24) and SIX.replace(pair=PAPER_PAIR.replace(teeth=31)).teeth == (
        31,
        31,
    )
    fixed = SIX.replace(torques=(1.0, 2.0), teeth=(24, 31), coast_deviation=Harmonics())
    changed = fixed.replace(load=1.0, deviation=Harmonics(), pair=PAPER_PAIR.replace(teeth=20))
    assert changed.torques == (1.0, 2.0) and changed.teeth == (24, 31) and changed.pair.load == 1.0
    damped = OSCILLATOR.replace(damping=0.3, upper_stiffness=3.0)
    assert (damped.upper_damping, damped.lower_damping, damped.lower_stiffness) == (0.3, 0.3, 3.0)
    unequal = OSCILLATOR.replace(upper_damping=0.2).replace(damping=0.0)
    assert (unequal.upper_damping, unequal.lower_damping) == (0.2, 0.0)


def test_the_reduced_mass_of_two_gears_matches_the_formula_of_two_bodies():
    """Reduced masses must follow from the sum of inverse masses at the line of action."""
    # A force accelerates free bodies in translation and in rotation: inverse masses add up.
    turning = (np.square(SIX.base_radii) / SIX.inertias).sum()
    assert SIX.reduced_mass_torsional == pytest.approx(1.0 / turning, rel=1e-14)
    moving = np.reciprocal(SIX.masses).sum()
    assert SIX.reduced_mass_free == pytest.approx(1.0 / (turning + moving), rel=1e-14)


@pytest.mark.parametrize(("model", "teeth"), [(PAPER_PAIR, 24), (UNEQUAL, 30), (TRAIN, 24)])
def test_a_run_at_a_speed_matches_its_tuning_and_reports_torques_if_radii_are_known(model, teeth):
    """A run at 2000 rpm must equal the run at its tuning and report the torques of known radii."""
    run = simulate(model, speed=2000.0, **RUN)
    # The mesh frequency is the number of teeth that pass in a second.
    per_second = float(run.mesh_frequency) / (2.0 * math.pi)
    assert per_second == pytest.approx(2000.0 / 60.0 * teeth, rel=1e-12)
    assert float(run.speed) == pytest.approx(2000.0, rel=1e-12)
    assert run.speed.attrs["units"] == "min-1"
    same = simulate(model, model.tuning_at(2000.0), **RUN)
    assert same.displacement.equals(run.displacement)
    # A pair without base radii has a force, but no torque.
    assert ("torque" in run) == (model is not PAPER_PAIR)
    if model is UNEQUAL:
        assert float(run.torque) == pytest.approx(PAPER_PAIR.load * 0.1, rel=1e-12)
    if model is TRAIN:
        # Each of three branches carries the load of the pair.
        torque = 3.0 * PAPER_PAIR.load * TRAIN.by_name["input"].base_radius
        assert float(run.torque.sel(body="input")) == pytest.approx(torque, rel=1e-12)
        assert run.torque.attrs["units"] == "N m"


EVEN = [f"{phase},{2.0 + math.cos(phase)}" for phase in np.arange(16) * math.pi / 8.0]
UNREADABLE_TABLES = {
    "line 3: stiffness = 'x' ... a number": ["0,1", "2,x"],
    "number of cells in line 3 = 1 ... 2": ["0,1", "2"],
    "number of cells in line 3 = 3 ... 2, ... semicolons": ["0,1", "1,5,2", "4,3"],
    "line 3: phase = '2.5' ... decimal sign ','": ["0;1,5", "2.5;3", "4;2"],
    "phase = 0.0 ... 0 to 2 pi rad": [
        f"{i / 16}{row[row.index(',') :]}" for i, row in enumerate(EVEN)
    ],
    "phase = 0.0 ... 5.9 ... 5.8 rad are left out": ["0,1", "0.1,2", "5.9,1"],
}


@pytest.mark.parametrize("sentence", UNREADABLE_TABLES)
def test_an_unreadable_table_is_refused_in_one_sentence(tmp_path, sentence):
    rows = UNREADABLE_TABLES[sentence]
    header = f"phase{';' if ';' in rows[0] else ','}stiffness"
    (tmp_path / "table.csv").write_text("\n".join([header, *rows]))
    with pytest.raises(ValueError, match=" is not allowed: ") as refusal:
        Tabulated.read(tmp_path / "table.csv")
    assert_sentence(refusal.value, f"table.csv: ... {sentence}")


def test_stiffness_tables_are_read_and_continued_periodically(tmp_path):
    """Read tables of stiffness in several CSV formats and continue them over the period."""
    path = tmp_path / "table.csv"
    rows = zip(TABLE.phase, TABLE.stiffness, strict=True)
    path.write_text("phase,stiffness\n" + "".join(f"{p},{c}\n" for p, c in rows), encoding="utf-8")
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match=r"stiffness = 'C' .* \['phase', 'stiffness'\]"):
        Tabulated.read(path, stiffness="C")
    # Spreadsheets may write decimal commas, an additional column and a byte order mark.
    german = path.read_text().replace(",", ";").replace(".", ",").replace("\n", ";\r\n")
    path.write_bytes(f"\ufeff{german};;\r\n".encode())
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match="^path = .* CSV"):
        Tabulated.read(tmp_path / "none.csv")
    # The last step, of stiffness 2, lasts until the first one begins in the next period.
    pieces = Steps(phase=(1.0, 3.0), stiffness=(5.0, 2.0)).piecewise_stiffness()
    np.testing.assert_array_equal(pieces.breakpoints, [0.0, 1.0, 3.0, 2.0 * math.pi])
    np.testing.assert_array_equal(pieces.values_and_slopes, [[2.0, 0.0], [5.0, 0.0], [2.0, 0.0]])
    # Pieces below the mean stiffness count as low.
    np.testing.assert_array_equal(pieces.is_below_mean, [True, False, True])


def test_harmonics_of_a_tabulated_profile_are_recovered():
    """The Fourier fit must return the two harmonics of which the table was made."""
    phase = 0.3 + 2 * math.pi * np.arange(16) / 16
    values = np.cos(phase) - 0.5 * np.cos(2 * phase) + 0.25 * np.sin(phase)
    fitted = Harmonics.from_table(phase, values, 2).table()
    np.testing.assert_allclose(fitted, [[1, 1.0, 0.25], [2, -0.5, 0.0]], atol=1e-15)


@pytest.mark.parametrize(
    "call", [lambda pair: simulate(pair, 0.9, **SPAN), lambda pair: sweep(pair, [0.7, 0.9], **SPAN)]
)
def test_units_of_variables_show_their_scaling(call):
    """Each variable must change by the factor of its unit if all units change."""
    # Units of length, mass and time change by powers of two, which cause no rounding.
    length, mass, time = 2.0, 4.0, 2.0
    pair = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=500.0)
    changed = in_units(pair, length, mass, time)
    first, second = call(pair), call(changed)
    for name, variable in first.variables.items():
        if variable.dtype.kind in "fi":
            # CF writes powers without a sign for them.
            text = re.sub(r"(?<=[a-z])(-?[0-9])", r"**\1", variable.attrs["units"])
            factor = unit_factor(text, length, mass, time)
            np.testing.assert_array_equal(second[name], factor * variable, err_msg=name)


def test_exceeding_the_event_limit_gives_a_status_and_nan():
    """A run with more events than allowed must have a status, a message and NaN."""
    chaotic = PAIR.replace(material_damping=0.0, backlash_damping=0.0)
    stopped_run = simulate(chaotic, 0.05, periods=3, max_events=5)
    assert (
        int(stopped_run.status) == 1 and "raise max_events" in stopped_run.status.attrs["message"]
    )
    assert stopped_run.displacement.isnull().all() and stopped_run.final_state.isnull().all()
    assert stopped_run.sizes["event"] == 0
    table = sweep(chaotic, [0.05], periods=300, record_periods=1, max_events=5)
    assert table.status.values.tolist() == [1] and table.displacement_max.isnull().all()


STEEP = PAPER_PAIR.replace(stiffness_ratio=0.2)


@pytest.mark.parametrize(
    ("period", "inverse", "bounces", "words"),
    [
        (0, 0.0, 0.0, "has not settled after 2 mesh periods; the flanks never part"),
        (1, 0.0, 1.0, "repeats every mesh period; it loses contact once per mesh period"),
        (2, 0.0, 0.5, "repeats every 2 mesh periods; it loses contact 0.5 times per mesh period"),
        (16, 0.01, 2.0, "repeats every 16 mesh periods; it strikes both flanks"),
    ],
)
def test_a_summary_describes_a_motion_in_words(period, inverse, bounces, words):
    run = simulate(PAPER_PAIR, 0.7, periods=2)
    run = run.assign(period=period, fraction_coast=inverse, bounces=bounces)
    assert describe_motion(run) == f"The motion from rest {words}."


@pytest.mark.parametrize("model", [STEEP, pairs_as_train(STEEP)])
def test_resonance_curves_end_where_motions_grow(model):
    """Curves must be masked where the largest displacement exceeds 1000 extents of the model."""
    # Without damping it grows in wide tongues, to some millions and beyond 1e8.
    curve = sweep(model, np.linspace(0.5, 1.4, 60), periods=70, record_periods=1)
    reach = np.abs(curve.displacement_max.values.reshape(60, -1)).max(axis=1)
    grown, shown = ~(reach <= 1e3 * model.extent), mask_unbounded(curve, model.extent)
    assert grown.any() and not grown.all() and np.nanmax(shown.displacement_max) < 1e4
    for name in ("displacement_min", "dynamic_force_max", "final_state"):
        gone = np.isnan(shown[name].values.reshape(60, -1)).all(axis=1)
        np.testing.assert_array_equal(gone, grown)
    assert shown.period.equals(curve.period) and shown.status.equals(curve.status)

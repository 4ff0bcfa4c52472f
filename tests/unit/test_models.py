"""Check copies of models, speeds, torques, units, stiffness tables and descriptions of motions."""

import dataclasses
import math
import re

import numpy as np
import pytest

import gearlib
from gearlib import GearPair, Harmonics, OneDegreePair, SixDegreePair, Tabulated, simulate, sweep
from gearlib.data.motions import describe_motion, mask_unbounded
from gearlib.data.status import EVENT_LIMIT
from gearlib.models.model import Model
from gearlib.models.profiles import Steps
from tests.paper import PAPER_PAIR
from tests.properties.changes import in_units, unit_factor
from tests.properties.known_models import TABLE, pairs_as_train
from tests.sentences import assert_sentence

ONE_DEGREE_PAIR = OneDegreePair(pair=PAPER_PAIR, cubic_damping=4e5, deviation=Harmonics((1e-6,)))
BODY_FIELDS = {"base_radii": (0.1, 0.08), "inertias": (0.06, 0.05), "masses": (17.0, 12.0)}
BEARING_FIELDS = {"bearing_stiffness": (1e8,) * 4}
SIX_DEGREE_PAIR = SixDegreePair(
    pair=PAPER_PAIR, deviation=Harmonics((1e-6,)), **BODY_FIELDS, **BEARING_FIELDS
)
OSCILLATOR = gearlib.DeadZoneOscillator(lower_edge=-1.0, upper_stiffness=2.0, damping=0.1)
GEARS_OF_DIFFERENT_TEETH, REDUCER = (
    SIX_DEGREE_PAIR.replace(teeth=(30, 24)),
    gearlib.split_power_reducer(PAPER_PAIR),
)
RUN_OPTIONS, SWEEP_OPTIONS = (
    {"periods": 4, "samples_per_period": 8},
    {"periods": 60, "record_periods": 4},
)
#: A pair with damping in contact and in free flight.
DAMPED_PAIR = GearPair.from_ratios(
    contact_ratio=1.569,
    stiffness_ratio=0.5879,
    damping=0.0617,
    backlash_damping=0.0617,
    backlash_ratio=4,
)


@pytest.mark.parametrize("model", [ONE_DEGREE_PAIR, SIX_DEGREE_PAIR])
def test_a_model_takes_scales_and_ratios_from_its_pair(model):
    """Public attributes of the gear pair must be attributes of the model with equal values."""
    # Models lack some attributes of a pair and define others themselves.
    exceptions = {"from_geometry", "from_ratios", "RATIOS", "ratio_slopes"}
    exceptions |= {*vars(Model), *vars(model)}
    names = {name for name in dir(PAPER_PAIR) if not name.startswith("_")}
    for name in (names - exceptions) | {"speed_scales"}:
        value, expected = getattr(model, name), getattr(PAPER_PAIR, name)
        if callable(value):
            value, expected = value(0.8), expected(0.8)
        assert value == expected, name
    # Models with base radii also have a scale of torque.
    assert PAPER_PAIR.scales().items() <= model.scales().items()
    assert not hasattr(model, "from_ratios")


@pytest.mark.parametrize("model", [PAPER_PAIR, ONE_DEGREE_PAIR, SIX_DEGREE_PAIR, OSCILLATOR])
def test_a_copy_is_a_model_of_the_same_kind(model):
    """Replacing a field by its own value must give an equal model; unknown fields are refused."""
    for name in {field.name for field in dataclasses.fields(model)} - {"pair"}:
        assert model.replace(**{name: getattr(model, name)}) == model
    with pytest.raises(ValueError, match="stiffness_raito is not allowed: .* are .*stiffness"):
        model.replace(stiffness_raito=0.5)


@pytest.mark.parametrize("model", [ONE_DEGREE_PAIR, SIX_DEGREE_PAIR])
def test_a_copy_changes_the_model_or_its_pair(model):
    """`replace` must change fields of the pair in the pair, and all others in the model."""
    changed = model.replace(backlash=20e-6, deviation=Harmonics((2e-6,)))
    assert type(changed) is type(model) and changed.deviation == Harmonics((2e-6,))
    assert changed.pair == PAPER_PAIR.replace(backlash=20e-6)
    pair = PAPER_PAIR.replace(contact_ratio=1.4)
    assert model.replace(pair=pair, backlash=math.inf).pair == pair.replace(backlash=math.inf)
    for name, value in (("backlash", -1), ("pair", 3)):
        with pytest.raises(ValueError, match=f"{name} = {value}"):
            model.replace(**{name: value})


def test_a_copy_computes_derived_defaults_anew_and_keeps_explicit_values():
    """Defaults that follow from other fields must change with these, explicit values must not."""
    heavier = SIX_DEGREE_PAIR.replace(load=2.0 * PAPER_PAIR.load)
    assert heavier.torques == tuple(2.0 * torque for torque in SIX_DEGREE_PAIR.torques)
    assert SIX_DEGREE_PAIR.replace(base_radii=(0.2, 0.1)).torques == (
        0.2 * PAPER_PAIR.load,
        0.1 * PAPER_PAIR.load,
    )
    assert SIX_DEGREE_PAIR.replace(deviation=Harmonics((2e-6,))).coast_deviation == Harmonics(
        (2e-6,)
    )
    assert SIX_DEGREE_PAIR.teeth == (24, 24) and SIX_DEGREE_PAIR.replace(
        pair=PAPER_PAIR.replace(teeth=31)
    ).teeth == (
        31,
        31,
    )
    fixed = SIX_DEGREE_PAIR.replace(torques=(1.0, 2.0), teeth=(24, 31), coast_deviation=Harmonics())
    changed = fixed.replace(load=1.0, deviation=Harmonics(), pair=PAPER_PAIR.replace(teeth=20))
    assert changed.torques == (1.0, 2.0) and changed.teeth == (24, 31) and changed.pair.load == 1.0
    damped = OSCILLATOR.replace(damping=0.3, upper_stiffness=3.0)
    assert (damped.upper_damping, damped.lower_damping, damped.lower_stiffness) == (0.3, 0.3, 3.0)
    unequal = OSCILLATOR.replace(upper_damping=0.2).replace(damping=0.0)
    assert (unequal.upper_damping, unequal.lower_damping) == (0.2, 0.0)


def test_the_reduced_mass_of_two_gears_matches_the_formula_of_two_bodies():
    """The inverse reduced mass must be the sum of the inverse masses at the line of action.

    A mesh force accelerates both gears in rotation and, without bearings, in translation.
    """
    inverse_rotational_mass = (
        np.square(SIX_DEGREE_PAIR.base_radii) / SIX_DEGREE_PAIR.inertias
    ).sum()
    assert SIX_DEGREE_PAIR.reduced_mass_torsional == pytest.approx(
        1.0 / inverse_rotational_mass, rel=1e-14
    )
    inverse_mass = inverse_rotational_mass + np.reciprocal(SIX_DEGREE_PAIR.masses).sum()
    assert SIX_DEGREE_PAIR.reduced_mass_free == pytest.approx(1.0 / inverse_mass, rel=1e-14)


@pytest.mark.parametrize(
    ("model", "teeth"), [(PAPER_PAIR, 24), (GEARS_OF_DIFFERENT_TEETH, 30), (REDUCER, 24)]
)
def test_a_run_at_a_speed_matches_its_tuning_and_reports_torques_if_radii_are_known(model, teeth):
    """A run at 2000 rpm must equal the run at the corresponding tuning.

    If base radii are known, it must report the torques.
    """
    speed = 2000.0
    run = simulate(model, speed=speed, **RUN_OPTIONS)
    # The mesh frequency is the rotational frequency times the number of teeth.
    mesh_frequency = float(run.mesh_frequency) / (2.0 * math.pi)
    assert mesh_frequency == pytest.approx(speed / 60.0 * teeth, rel=1e-12)
    assert float(run.speed) == pytest.approx(speed, rel=1e-12)
    assert run.speed.attrs["units"] == "min-1"
    run_at_tuning = simulate(model, model.tuning_at(speed), **RUN_OPTIONS)
    assert run_at_tuning.displacement.equals(run.displacement)
    # A pair without base radii has a force, but no torque.
    assert ("torque" in run) == (model is not PAPER_PAIR)
    if model is GEARS_OF_DIFFERENT_TEETH:
        pinion_radius = BODY_FIELDS["base_radii"][0]
        assert float(run.torque) == pytest.approx(PAPER_PAIR.load * pinion_radius, rel=1e-12)
    if model is REDUCER:
        # Each of three branches carries the load of the pair.
        torque = 3.0 * PAPER_PAIR.load * REDUCER.by_name["input"].base_radius
        assert float(run.torque.sel(body="input")) == pytest.approx(torque, rel=1e-12)
        assert run.torque.attrs["units"] == "N m"


FULL_PERIOD_ROWS = [f"{phase},{2.0 + math.cos(phase)}" for phase in np.arange(16) * math.pi / 8.0]
UNREADABLE_TABLES = {
    "line 3: stiffness = 'x' ... a number": ["0,1", "2,x"],
    "number of cells in line 3 = 1 ... 2": ["0,1", "2"],
    "number of cells in line 3 = 3 ... 2, ... semicolons": ["0,1", "1,5,2", "4,3"],
    "line 3: phase = '2.5' ... decimal mark ','": ["0;1,5", "2.5;3", "4;2"],
    "phase = 0.0 ... 0 to 2 pi rad": [
        f"{i / 16}{row[row.index(',') :]}" for i, row in enumerate(FULL_PERIOD_ROWS)
    ],
    "phase = 0.0 ... 5.9 ... it has a gap of 5.8 rad": ["0,1", "0.1,2", "5.9,1"],
}


@pytest.mark.parametrize("sentence", UNREADABLE_TABLES)
def test_an_unreadable_table_is_refused_in_one_sentence(tmp_path, sentence):
    """`Tabulated.read` must refuse a table by a sentence that names the file and the problem."""
    rows = UNREADABLE_TABLES[sentence]
    separator = ";" if ";" in rows[0] else ","
    header = f"phase{separator}stiffness"
    (tmp_path / "table.csv").write_text("\n".join([header, *rows]))
    with pytest.raises(ValueError, match=" is not allowed: ") as refusal:
        Tabulated.read(tmp_path / "table.csv")
    assert_sentence(refusal.value, f"table.csv: ... {sentence}")


def test_stiffness_tables_are_read_and_continued_periodically(tmp_path):
    """Tables in several CSV formats must give equal profiles, which repeat after 2 pi rad."""
    path = tmp_path / "table.csv"
    pairs = zip(TABLE.phase, TABLE.stiffness, strict=True)
    rows = [f"{phase},{stiffness}\n" for phase, stiffness in pairs]
    path.write_text("phase,stiffness\n" + "".join(rows), encoding="utf-8")
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match=r"stiffness = 'C' .* \['phase', 'stiffness'\]"):
        Tabulated.read(path, stiffness="C")
    # Spreadsheets may write decimal commas, an additional column and a byte order mark.
    german_table = path.read_text().replace(",", ";").replace(".", ",").replace("\n", ";\r\n")
    path.write_bytes(f"\ufeff{german_table};;\r\n".encode())
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match="^path = .* CSV"):
        Tabulated.read(tmp_path / "none.csv")
    # The last step, of stiffness 2, lasts until the first step begins in the next period.
    pieces = Steps(phase=(1.0, 3.0), stiffness=(5.0, 2.0)).piecewise_stiffness()
    np.testing.assert_array_equal(pieces.breakpoints, [0.0, 1.0, 3.0, 2.0 * math.pi])
    np.testing.assert_array_equal(pieces.values_and_slopes, [[2.0, 0.0], [5.0, 0.0], [2.0, 0.0]])
    # The mean stiffness, about 3, lies between both values.
    np.testing.assert_array_equal(pieces.is_below_mean, [True, False, True])


def test_harmonics_of_a_tabulated_profile_are_recovered():
    """The Fourier fit must return the two harmonics from which the table was computed."""
    phase = 0.3 + 2 * math.pi * np.arange(16) / 16
    values = np.cos(phase) - 0.5 * np.cos(2 * phase) + 0.25 * np.sin(phase)
    fitted = Harmonics.from_table(phase, values, 2).table()
    np.testing.assert_allclose(fitted, [[1, 1.0, 0.25], [2, -0.5, 0.0]], atol=1e-15)


@pytest.mark.parametrize(
    "call",
    [
        lambda pair: simulate(pair, 0.9, **SWEEP_OPTIONS),
        lambda pair: sweep(pair, [0.7, 0.9], **SWEEP_OPTIONS),
    ],
)
def test_units_of_variables_show_their_scaling(call):
    """If all units change, each variable must change by the factor that its unit implies."""
    # Units of length, mass and time change by powers of two, which cause no rounding.
    length, mass, time = 2.0, 4.0, 2.0
    pair = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=500.0)
    dataset, changed_dataset = call(pair), call(in_units(pair, length, mass, time))
    for name, variable in dataset.variables.items():
        if variable.dtype.kind in "fi":
            # CF units such as "m s-2" have no operator for powers.
            unit_expression = re.sub(r"(?<=[a-z])(-?[0-9])", r"**\1", variable.attrs["units"])
            factor = unit_factor(unit_expression, length, mass, time)
            np.testing.assert_array_equal(changed_dataset[name], factor * variable, err_msg=name)


def test_exceeding_the_event_limit_gives_a_status_and_nan():
    """A run with more events than allowed must have the status EVENT_LIMIT, a message and NaN."""
    undamped_pair = DAMPED_PAIR.replace(material_damping=0.0, backlash_damping=0.0)
    stopped_run = simulate(undamped_pair, 0.05, periods=3, max_events=5)
    assert int(stopped_run.status) == EVENT_LIMIT
    assert "raise max_events" in stopped_run.status.attrs["message"]
    assert stopped_run.displacement.isnull().all() and stopped_run.final_state.isnull().all()
    assert stopped_run.sizes["event"] == 0
    curve = sweep(undamped_pair, [0.05], periods=300, record_periods=1, max_events=5)
    assert curve.status.values.tolist() == [EVENT_LIMIT] and curve.displacement_max.isnull().all()


UNDAMPED_PAIR = PAPER_PAIR.replace(stiffness_ratio=0.2)


@pytest.mark.parametrize(
    ("period", "coast_fraction", "bounces", "description"),
    [
        (0, 0.0, 0.0, "has not settled after 2 mesh periods; the flanks never part"),
        (1, 0.0, 1.0, "repeats every mesh period; it loses contact once per mesh period"),
        (2, 0.0, 0.5, "repeats every 2 mesh periods; it loses contact 0.5 times per mesh period"),
        (16, 0.01, 2.0, "repeats every 16 mesh periods; it strikes both flanks"),
    ],
)
def test_a_summary_describes_a_motion_in_words(period, coast_fraction, bounces, description):
    run = simulate(PAPER_PAIR, 0.7, periods=2)
    run = run.assign(period=period, fraction_coast=coast_fraction, bounces=bounces)
    assert describe_motion(run) == f"The motion from rest {description}."


@pytest.mark.parametrize(
    "model",
    [UNDAMPED_PAIR, pairs_as_train(UNDAMPED_PAIR)],
)
def test_resonance_curves_end_where_motions_grow(model):
    """Curves must be masked where the largest displacement exceeds 1000 extents of the model."""
    # Without damping, motions grow in wide ranges of the tuning, to millions of deflections.
    tuning_count = 60
    tunings = np.linspace(0.5, 1.4, tuning_count)
    curve = sweep(model, tunings, periods=70, record_periods=1)
    # A train has several meshes per tuning.
    displacements = np.abs(curve.displacement_max.values.reshape(tuning_count, -1)).max(axis=1)
    # NaN, the result of an overflow, counts as unbounded.
    is_unbounded = ~(displacements <= 1e3 * model.extent)
    masked_curve = mask_unbounded(curve, model.extent)
    assert is_unbounded.any() and not is_unbounded.all()
    assert np.nanmax(masked_curve.displacement_max) < 1e4
    for name in ("displacement_min", "dynamic_force_max", "final_state"):
        values = masked_curve[name].values.reshape(tuning_count, -1)
        np.testing.assert_array_equal(np.isnan(values).all(axis=1), is_unbounded)
    assert masked_curve.period.equals(curve.period) and masked_curve.status.equals(curve.status)

"""`gearlib.scatter`: bands against loops of `sweep`, shards, probabilities of motions."""

import numpy as np
import pytest

import gearlib
from gearlib.data import storage
from gearlib.uncertainty.designs import Designs
from gearlib.uncertainty.scatter import QUANTILES, join_shards, refused, scatter, shard
from tests.paper import PAPER_PAIR

PAIR = PAPER_PAIR.replace(material_damping=3953.7)
MANY = {
    "load": {"mean": 3300.0, "std": 150.0},
    "backlash": {"nominal": 40e-6, "upper": 10e-6, "lower": -4e-6},
    "damping_ratio": {"min": 0.03, "max": 0.17},
    "correlations": [["load", "backlash", 0.4]],
}
TUNINGS = np.linspace(0.6, 1.1, 11)
RUNS = {"tunings": TUNINGS, "quantities": (), "directions": ("up", "down", "seeded")}


@pytest.fixture(scope="module")
def whole_scatter():
    """Return the scatter of all 100 samples, computed at once."""
    return scatter(PAIR, MANY, n=100, **RUNS)


def plain_sweeps(designs, count):
    """Return peak-to-peak displacement, dynamic factor and contact loss of sweeps of designs.

    The shape is (3, designs, directions, tunings); contact loss is 1 or 0.
    """
    points = designs.points(0, count)
    speeds, rows = PAIR.replace(load=3300.0, material_damping=0.0).speed(TUNINGS), []
    for point, values in zip(points, designs.values(points), strict=True):
        model = designs.model(values)
        for direction in RUNS["directions"]:
            start = {"direction": direction}
            if direction == "seeded":
                # A random state from the default box, -6 to 6 in both coordinates.
                start = {"initial_state": tuple(12.0 * point[-2:] - 6.0)}
            run = gearlib.sweep(model, speeds=speeds, periods=120, record_periods=20, **start)
            peak_to_peak = (run.displacement_max - run.displacement_min) * run.static_deflection
            rows.append((peak_to_peak, run.dynamic_force_max, run.bounces > 0.0))
    return np.array(rows).reshape(count, 3, 3, TUNINGS.size).transpose(2, 0, 1, 3)


def test_bands_match_quantiles_of_plain_sweeps():
    """Compare bands and probabilities with quantiles and means of plain sweeps of 24 designs."""
    designs = Designs(PAIR, MANY)
    peak_to_peak, dynamic_factor, loses_contact = plain_sweeps(designs, 24)
    result = scatter(PAIR, MANY, n=24, **RUNS)
    for name, values in (("height_band", peak_to_peak), ("factor_band", dynamic_factor)):
        # Bands are stored in single precision.
        assert np.allclose(result[name], np.quantile(values, QUANTILES, axis=0), rtol=3e-7)
    assert np.array_equal(result.contact_loss_probability, loses_contact.mean(axis=0))
    up, down = peak_to_peak[:, 0], peak_to_peak[:, 1]
    has_two_motions = np.abs(up - down) > 0.02 * np.maximum(up, down)
    assert has_two_motions.any() and np.allclose(
        result.two_motions_probability, has_two_motions.mean(axis=0)
    )


def test_any_division_into_shards_gives_the_same_bytes(whole_scatter, tmp_path):
    """Join shards of 3, 47 and 50 samples, and refuse missing or foreign ones."""
    sample_ranges = [(50, 100), (0, 3), (3, 50)]
    for index, sample_range in enumerate(sample_ranges):
        samples = shard(PAIR, MANY, 100, *sample_range, threads=index + 1, **RUNS)
        storage.write(samples, tmp_path / f"{index}.nc")
    parts = [storage.read(tmp_path / f"{index}.nc") for index in range(3)]
    storage.write(join_shards(parts), tmp_path / "parts.nc")
    storage.write(whole_scatter, tmp_path / "whole.nc")
    assert (tmp_path / "parts.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()
    with pytest.raises(ValueError, match="each of the samples 0 to 99 once"):
        join_shards(parts[:2])
    with pytest.raises(ValueError, match="parts of one scatter"):
        join_shards([shard(PAIR, MANY, 100, 0, 3, seed=1, **RUNS), *parts[::2]])


def test_random_starts_lead_to_both_motions_where_sweeps_up_and_down_differ(whole_scatter):
    """Probabilities of the motions must agree with the hysteresis of the sweeps."""
    two_motions, motion_probability = (
        whole_scatter.two_motions_probability,
        whole_scatter.motion_probability,
    )
    assert np.allclose(motion_probability.sum("motion"), 1.0)
    assert float(two_motions.max()) > 0.3 and not two_motions[-1]
    # Random initial states lead to both motions only where sweeps up and down differ.
    either_motion = motion_probability.sel(motion=["lower", "higher"]).sum("motion")
    assert (either_motion <= two_motions + 1e-12).all() and (either_motion > 0.0)[
        two_motions > 0.2
    ].all()
    assert (motion_probability.sel(motion="higher") > 0.0)[two_motions > 0.3].all()
    contact_loss = whole_scatter.contact_loss_probability
    # Downward sweeps arrive from the resonance and so lose contact at least as often.
    assert (contact_loss.sel(direction="down") >= contact_loss.sel(direction="up") - 0.02).all()
    assert int(whole_scatter.failed_runs.sum()) == 0 and (whole_scatter.run_count == 100).all()


def test_samples_that_cannot_be_built_are_counted_and_reported():
    """Samples with a contact ratio above 2 must be counted as refused, and not be run."""
    options = {"contact_ratio": {"mean": 1.9, "std": 0.1}}
    result = scatter(PAIR, options, n=128, tunings=[0.9], quantities=())
    count = int((result.refusal != "").sum())
    assert count == int((result.contact_ratio > 2.0).sum()) > 10
    assert (result.run_count == 128 - count).all() and not result.failed_runs.any()
    (text,) = refused(result)
    assert text.startswith(f"{count} of 128 samples cannot be built, e.g.: contact_ratio = 2.")


def test_jump_and_onset_speeds_of_samples_match_their_models():
    """Speeds of random samples must agree with sweeps of the sampled models."""
    options = {"max_stiffness": {"std": "1 %"}, "contact_ratio": {"mean": 1.9, "std": 0.06}}
    names = ("jump_up", "onset_of_contact_loss")
    result = scatter(PAIR, options, names, n=16)
    parts = [shard(PAIR, options, 16, *ends, quantities=names) for ends in ((5, 16), (0, 5))]
    assert join_shards(parts).identical(result)
    can_be_built = result.refusal.values == ""
    assert 0 < can_be_built.sum() < 16
    for name in names:
        assert np.array_equal(result[f"{name}_status"].values == -1, ~can_be_built)
    i = int(np.argmax(can_be_built))
    designs = Designs(PAIR, options)
    model = designs.model(designs.values(designs.points(i, i + 1))[0])
    # Contact is lost at one of two speeds that are just below and above the onset.
    speed = float(result.onset_of_contact_loss[i])
    speeds = [speed * (1.0 - 1e-4), speed * (1.0 + 1e-4)]
    run = gearlib.sweep(model, speeds=speeds, periods=600, record_periods=20, direction="down")
    assert run.bounces.values.astype(bool).sum() == 1
    # A natural frequency deviates by half the relative deviation of the stiffness, 1 %.
    nominal = scatter(PAIR, {"max_stiffness": {"std": "1 %"}, "load": {"std": "1 %"}}, names, n=16)
    for name in names:
        share = float(nominal[f"{name}_deviation"] / nominal[f"{name}_nominal"])
        assert 0.004 < share < 0.006, name

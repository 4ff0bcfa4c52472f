"""Compare bands and probabilities of `gearlib.scatter` with plain sweeps; check its shards."""

import numpy as np
import pytest

import gearlib
from gearlib.data import storage
from gearlib.uncertainty.designs import Designs
from gearlib.uncertainty.scatter import QUANTILES, join_shards, refused, scatter, shard
from tests.paper import PAPER_PAIR

NOMINAL_PAIR = PAPER_PAIR.replace(material_damping=3953.7)
TOLERANCES = {
    "load": {"mean": 3300.0, "std": 150.0},
    "backlash": {"nominal": 40e-6, "upper": 10e-6, "lower": -4e-6},
    "damping_ratio": {"min": 0.03, "max": 0.17},
    "correlations": [["load", "backlash", 0.4]],
}
TUNINGS = np.linspace(0.6, 1.1, 11)
SCATTER_OPTIONS = {"tunings": TUNINGS, "quantities": (), "directions": ("up", "down", "seeded")}


@pytest.fixture(scope="module")
def whole_scatter():
    """Return the scatter of all 100 samples, computed in a single call."""
    return scatter(NOMINAL_PAIR, TOLERANCES, n=100, **SCATTER_OPTIONS)


def plain_sweeps(designs, count):
    """Return peak-to-peak displacement, dynamic factor and contact loss of `count` designs.

    The shape is (3, designs, directions, tunings). The value of contact loss is 1 or 0.
    """
    points = designs.points(0, count)
    speeds, rows = NOMINAL_PAIR.replace(load=3300.0, material_damping=0.0).speed(TUNINGS), []
    for point, values in zip(points, designs.values(points), strict=True):
        model = designs.model(values)
        for direction in SCATTER_OPTIONS["directions"]:
            if direction == "seeded":
                # The last two coordinates of a point give an initial state between -6 and 6.
                options = {"initial_state": tuple(12.0 * point[-2:] - 6.0)}
            else:
                options = {"direction": direction}
            run = gearlib.sweep(model, speeds=speeds, periods=120, record_periods=20, **options)
            peak_to_peak = (run.displacement_max - run.displacement_min) * run.static_deflection
            rows.append((peak_to_peak, run.dynamic_force_max, run.bounces > 0.0))
    direction_count = len(SCATTER_OPTIONS["directions"])
    results = np.array(rows).reshape(count, direction_count, 3, TUNINGS.size)
    return results.transpose(2, 0, 1, 3)


def test_bands_match_quantiles_of_plain_sweeps():
    """Bands and probabilities must be the quantiles and means of plain sweeps of all designs."""
    designs, count = Designs(NOMINAL_PAIR, TOLERANCES), 24
    peak_to_peak, dynamic_factor, loses_contact = plain_sweeps(designs, count)
    result = scatter(NOMINAL_PAIR, TOLERANCES, n=count, **SCATTER_OPTIONS)
    for name, values in (("height_band", peak_to_peak), ("factor_band", dynamic_factor)):
        # Bands are stored in single precision.
        assert np.allclose(result[name], np.quantile(values, QUANTILES, axis=0), rtol=3e-7)
    assert np.array_equal(result.contact_loss_probability, loses_contact.mean(axis=0))
    # Motions of sweeps up and down that differ by more than 2 % count as two motions.
    up, down = peak_to_peak[:, 0], peak_to_peak[:, 1]
    has_two_motions = np.abs(up - down) > 0.02 * np.maximum(up, down)
    assert has_two_motions.any()
    assert np.allclose(result.two_motions_probability, has_two_motions.mean(axis=0))


def test_any_division_into_shards_gives_the_same_bytes(whole_scatter, tmp_path):
    """Shards of 3, 47 and 50 samples must give the same file as a single call.

    Missing shards, or shards with another random seed, must be refused.
    """
    sample_ranges, shards = [(50, 100), (0, 3), (3, 50)], []
    for index, sample_range in enumerate(sample_ranges):
        samples = shard(
            NOMINAL_PAIR, TOLERANCES, 100, *sample_range, threads=index + 1, **SCATTER_OPTIONS
        )
        storage.write(samples, tmp_path / f"{index}.nc")
        shards.append(storage.read(tmp_path / f"{index}.nc"))
    storage.write(join_shards(shards), tmp_path / "joined.nc")
    storage.write(whole_scatter, tmp_path / "whole.nc")
    assert (tmp_path / "joined.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()
    with pytest.raises(ValueError, match="each of the samples 0 to 99 once"):
        join_shards(shards[:2])
    shard_with_other_seed = shard(NOMINAL_PAIR, TOLERANCES, 100, 0, 3, seed=1, **SCATTER_OPTIONS)
    with pytest.raises(ValueError, match="parts of one scatter"):
        join_shards([shard_with_other_seed, shards[0], shards[2]])


def test_random_starts_lead_to_both_motions_where_sweeps_up_and_down_differ(whole_scatter):
    """Random initial states must lead to two motions only where sweeps up and down differ."""
    two_motions = whole_scatter.two_motions_probability
    motion_probability = whole_scatter.motion_probability
    assert np.allclose(motion_probability.sum("motion"), 1.0)
    assert float(two_motions.max()) > 0.3 and not two_motions[-1]
    either_motion = motion_probability.sel(motion=["lower", "higher"]).sum("motion")
    assert (either_motion <= two_motions + 1e-12).all()
    assert (either_motion > 0.0)[two_motions > 0.2].all()
    assert (motion_probability.sel(motion="higher") > 0.0)[two_motions > 0.3].all()
    contact_loss = whole_scatter.contact_loss_probability
    # Downward sweeps come from the resonance, and so lose contact at least as often. Two of 100
    # samples may be exceptions.
    assert (contact_loss.sel(direction="down") >= contact_loss.sel(direction="up") - 0.02).all()
    assert int(whole_scatter.failed_runs.sum()) == 0 and (whole_scatter.run_count == 100).all()


def test_samples_that_cannot_be_built_are_counted_and_reported():
    """Samples with a contact ratio above 2, which is not allowed, must be counted, but not run."""
    tolerances, count = {"contact_ratio": {"mean": 1.9, "std": 0.1}}, 128
    result = scatter(NOMINAL_PAIR, tolerances, n=count, tunings=[0.9], quantities=())
    refused_count = int((result.refusal != "").sum())
    assert refused_count == int((result.contact_ratio > 2.0).sum()) > 10
    assert (result.run_count == count - refused_count).all() and not result.failed_runs.any()
    (message,) = refused(result)
    beginning = f"{refused_count} of {count} samples cannot be built, e.g.: contact_ratio = 2."
    assert message.startswith(beginning)


def test_jump_and_onset_speeds_of_samples_match_their_models():
    """The onset of contact loss of a sample must agree with a sweep of the sampled model.

    The speeds must scatter by half the relative deviation of the stiffness, as natural frequencies.
    """
    tolerances = {"max_stiffness": {"std": "1 %"}, "contact_ratio": {"mean": 1.9, "std": 0.06}}
    names, count = ("jump_up", "onset_of_contact_loss"), 16
    result = scatter(NOMINAL_PAIR, tolerances, names, n=count)
    shards = [
        shard(NOMINAL_PAIR, tolerances, count, *sample_range, quantities=names)
        for sample_range in ((5, count), (0, 5))
    ]
    assert join_shards(shards).identical(result)
    can_be_built = result.refusal.values == ""
    assert 0 < can_be_built.sum() < count
    for name in names:
        assert np.array_equal(result[f"{name}_status"].values == -1, ~can_be_built)
    i = int(np.argmax(can_be_built))
    designs = Designs(NOMINAL_PAIR, tolerances)
    model = designs.model(designs.values(designs.points(i, i + 1))[0])
    # Contact must be lost just above the onset, but not just below it.
    speed = float(result.onset_of_contact_loss[i])
    speeds = [speed * (1.0 - 1e-4), speed * (1.0 + 1e-4)]
    run = gearlib.sweep(model, speeds=speeds, periods=600, record_periods=20, direction="down")
    assert run.bounces.values.astype(bool).sum() == 1
    tolerances = {"max_stiffness": {"std": "1 %"}, "load": {"std": "1 %"}}
    result = scatter(NOMINAL_PAIR, tolerances, names, n=count)
    for name in names:
        relative_deviation = float(result[f"{name}_deviation"] / result[f"{name}_nominal"])
        assert 0.004 < relative_deviation < 0.006, name

"""`gearlib.scatter`: bands against plain loops of `sweep`, shards, probabilities of branches."""

import numpy as np
import pytest

import gearlib
from gearlib.data import storage
from gearlib.uncertainty.designs import Designs
from gearlib.uncertainty.scatter import QUANTILES, join_shards, refused, scatter, shard
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
MANY = {
    "load": {"mean": 3300.0, "std": 150.0},
    "backlash": {"nominal": 40e-6, "upper": 10e-6, "lower": -4e-6},
    "damping_ratio": {"min": 0.03, "max": 0.17},
    "correlations": [["load", "backlash", 0.4]],
}
NU = np.linspace(0.6, 1.1, 11)
RUNS = {"tunings": NU, "quantities": (), "directions": ("up", "down", "seeded")}


@pytest.fixture(scope="module")
def whole():
    """The scatter of all 100 samples at once."""
    return scatter(PAIR, MANY, n=100, **RUNS)


def plain_sweeps(designs, count):
    """Return peak-to-peak displacement, dynamic factor and whether contact is lost, by `sweep`.

    The shape is (3, designs, directions, tunings).
    """
    points = designs.points(0, count)
    speeds, rows = PAIR.replace(load=3300.0, material_damping=0.0).speed(NU), []
    for point, values in zip(points, designs.values(points), strict=True):
        model = designs.model(values)
        for direction in RUNS["directions"]:
            start = {"direction": direction}
            if direction == "seeded":
                # A random state from the default box, -6 to 6 in both coordinates.
                start = {"initial_state": tuple(12.0 * point[-2:] - 6.0)}
            run = gearlib.sweep(model, speeds=speeds, periods=120, record_periods=20, **start)
            height = (run.displacement_max - run.displacement_min) * run.static_deflection
            rows.append((height, run.dynamic_force_max, run.bounces > 0.0))
    return np.array(rows).reshape(count, 3, 3, NU.size).transpose(2, 0, 1, 3)


def test_bands_match_quantiles_of_plain_sweeps():
    designs = Designs(PAIR, MANY)
    height, factor, lost = plain_sweeps(designs, 24)
    result = scatter(PAIR, MANY, n=24, **RUNS)
    for name, own in (("height_band", height), ("factor_band", factor)):
        # Bands are stored in single precision.
        assert np.allclose(result[name], np.quantile(own, QUANTILES, axis=0), rtol=3e-7)
    assert np.array_equal(result.contact_loss_probability, lost.mean(axis=0))
    up, down = height[:, 0], height[:, 1]
    two = np.abs(up - down) > 0.02 * np.maximum(up, down)
    assert two.any() and np.allclose(result.two_motions_probability, two.mean(axis=0))


def test_any_division_into_shards_gives_the_same_bytes(whole, tmp_path):
    cuts = [(50, 100), (0, 3), (3, 50)]
    for i, ends in enumerate(cuts):
        part = shard(PAIR, MANY, 100, *ends, threads=i + 1, **RUNS)
        storage.write(part, tmp_path / f"{i}.nc")
    parts = [storage.read(tmp_path / f"{i}.nc") for i in range(3)]
    storage.write(join_shards(parts), tmp_path / "parts.nc")
    storage.write(whole, tmp_path / "whole.nc")
    assert (tmp_path / "parts.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()
    with pytest.raises(ValueError, match="each of the samples 0 to 99 once"):
        join_shards(parts[:2])
    with pytest.raises(ValueError, match="parts of one scatter"):
        join_shards([shard(PAIR, MANY, 100, 0, 3, seed=1, **RUNS), *parts[::2]])


def test_random_starts_lead_to_both_motions_where_sweeps_up_and_down_differ(whole):
    two, motion = whole.two_motions_probability, whole.motion_probability
    assert np.allclose(motion.sum("motion"), 1.0)
    assert float(two.max()) > 0.3 and not two[-1]
    # The starts of seeded runs lead to both motions where the sweeps up and down differ.
    both = motion.sel(motion=["lower", "higher"]).sum("motion")
    assert (both <= two + 1e-12).all() and (both > 0.0)[two > 0.2].all()
    assert (motion.sel(motion="higher") > 0.0)[two > 0.3].all()
    lost = whole.contact_loss_probability
    # Sweeps down, which come from the resonance, lose contact at least as often.
    assert (lost.sel(direction="down") >= lost.sel(direction="up") - 0.02).all()
    assert int(whole.failed_runs.sum()) == 0 and (whole.run_count == 100).all()


def test_samples_that_cannot_be_built_are_counted_and_reported():
    options = {"contact_ratio": {"mean": 1.9, "std": 0.1}}
    result = scatter(PAIR, options, n=128, tunings=[0.9], quantities=())
    count = int((result.refusal != "").sum())
    assert count == int((result.contact_ratio > 2.0).sum()) > 10
    assert (result.run_count == 128 - count).all() and not result.failed_runs.any()
    (text,) = refused(result)
    assert text.startswith(f"{count} of 128 samples cannot be built, such as: contact_ratio = 2.")


def test_jump_and_onset_speeds_of_samples_match_their_models():
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

"""The comparison with golden data: which changes it notices."""

import numpy as np
import pytest
import xarray as xr

from tests.golden import data


def sweep_up():
    """Return an upward sweep of four tunings, whose third motion has not settled."""
    names = ("displacement_max", "contact_loss_fraction")
    values = {name: ("tuning", np.array([0.1, 0.2, 0.3, 0.4])) for name in names}
    values["period"] = ("tuning", np.array([1, 2, 0, 1]))
    coords = {"tuning": [0.5, 0.6, 0.7, 0.8], "direction": "up", "damping": "k1"}
    return xr.Dataset(values, coords)


@pytest.mark.parametrize(
    ("name", "index", "change", "noticed"),
    [
        ("displacement_max", 0, 1e-11, False),
        ("displacement_max", 0, 1e-6, True),
        ("displacement_max", 0, np.nan, True),
        ("displacement_max", 2, 5.0, False),
        # This motion follows the one that has not settled.
        ("displacement_max", 3, 5.0, False),
        ("contact_loss_fraction", 2, 0.01, False),
        ("contact_loss_fraction", 2, 0.6, True),
        ("period", 2, 1, True),
    ],
)
def test_changed_numbers_are_noticed_where_motions_settle(name, index, change, noticed):
    changed = sweep_up()
    changed[name][index] += change
    assert len(data.differences("sweep.nc", sweep_up(), changed)) == noticed


@pytest.mark.parametrize(
    "change",
    [
        lambda dataset: dataset.drop_vars("period"),
        lambda dataset: dataset.assign(bounces=1.0),
        lambda dataset: dataset.isel(tuning=[0, 1]),
        lambda dataset: dataset.assign_coords(damping="k1m"),
    ],
)
def test_changed_variables_sizes_and_texts_are_noticed(change):
    assert data.differences("sweep.nc", sweep_up(), sweep_up()) == []
    assert len(data.differences("sweep.nc", sweep_up(), change(sweep_up()))) == 1

"""The comparison with golden data notices changes that matter and ignores the others."""

import numpy as np
import pytest
import xarray as xr

from tests.golden import data


def upward_sweep():
    """Return an upward sweep of four tunings in which the third motion has not settled."""
    names = ("displacement_max", "contact_loss_fraction")
    values = {name: ("tuning", np.array([0.1, 0.2, 0.3, 0.4])) for name in names}
    values["period"] = ("tuning", np.array([1, 2, 0, 1]))
    coords = {"tuning": [0.5, 0.6, 0.7, 0.8], "direction": "up", "damping": "k1"}
    return xr.Dataset(values, coords)


@pytest.mark.parametrize(
    ("name", "index", "change", "is_noticed"),
    [
        ("displacement_max", 0, 1e-11, False),
        ("displacement_max", 0, 1e-6, True),
        ("displacement_max", 0, np.nan, True),
        ("displacement_max", 2, 5.0, False),
        # This motion starts from the one that has not settled.
        ("displacement_max", 3, 5.0, False),
        ("contact_loss_fraction", 2, 0.01, False),
        ("contact_loss_fraction", 2, 0.6, True),
        ("period", 2, 1, True),
    ],
)
def test_changed_numbers_are_noticed_where_motions_settle(name, index, change, is_noticed):
    """A change must be noticed above the tolerance, which is large for unsettled motions."""
    changed_sweep = upward_sweep()
    changed_sweep[name][index] += change
    differences = data.describe_differences("sweep.nc", upward_sweep(), changed_sweep)
    assert len(differences) == is_noticed


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
    assert data.describe_differences("sweep.nc", upward_sweep(), upward_sweep()) == []
    changed_sweep = change(upward_sweep())
    assert len(data.describe_differences("sweep.nc", upward_sweep(), changed_sweep)) == 1

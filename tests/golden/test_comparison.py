"""The comparison with golden data itself: what it lets pass, and what not."""

import numpy as np
import pytest
import xarray as xr

from tests.golden import data
from tests.golden.tolerances import TABLE, tolerance

KNOWN = sorted(str(path.relative_to(data.FOLDER)) for path in data.FOLDER.rglob("*.nc"))


def curve():
    """Return a sweep of four tunings, whose third motion has no period."""
    names = ("displacement_max", "fraction_backlash")
    values = {name: ("tuning", np.array([0.1, 0.2, 0.3, 0.4])) for name in names}
    values["period"] = ("tuning", np.array([1, 2, 0, 1]))
    coords = {"tuning": [0.5, 0.6, 0.7, 0.8], "direction": "up", "damping": "k1"}
    return xr.Dataset(values, coords)


def test_what_verdicts_mean_is_compared():
    def of(words):
        return xr.Dataset({"verdict": ("trial", [0, 1], {"flag_meanings": words})})

    assert data.differences("a.nc", of("right wrong"), of("right wrong")) == []
    (words,) = data.differences("a.nc", of("right wrong"), of("wrong right"))
    assert words == "a.nc: flag_meanings was 'right wrong', is 'wrong right'"


@pytest.mark.parametrize(
    ("name", "place", "change", "moved"),
    [
        ("displacement_max", 0, 1e-11, False),
        ("displacement_max", 0, 1e-6, True),
        ("displacement_max", 0, np.nan, True),
        ("displacement_max", 2, 5.0, False),
        # After a motion that did not settle.
        ("displacement_max", 3, 5.0, False),
        ("fraction_backlash", 1, 1e-6, True),
        ("fraction_backlash", 2, 0.01, False),
        ("fraction_backlash", 2, 0.6, True),
        ("period", 0, 1, True),
        ("period", 2, 1, True),
    ],
)
def test_what_moves_is_seen(name, place, change, moved):
    found = curve()
    found[name][place] += change
    sentences = data.differences("curve.nc", curve(), found)
    assert len(sentences) == moved
    if moved:
        assert f"1 of 4 numbers of {name} moved, at ({place},)" in sentences[0]


def test_variables_sizes_and_texts():
    golden = curve()
    assert data.differences("a.nc", golden, golden) == []
    assert data.differences("a.nc", golden, golden.drop_vars("period")) == ["a.nc: period is gone"]
    more = golden.assign(bounces=1.0)
    assert data.differences("a.nc", golden, more) == ["a.nc: bounces has no golden data"]
    (words,) = data.differences("a.nc", golden, golden.isel(tuning=[0, 1]))
    assert "sizes" in words
    (words,) = data.differences("a.nc", golden, golden.assign_coords(damping="k1m"))
    assert "damping was k1, is k1m" in words


def test_what_is_kept(tmp_path):
    times = xr.DataArray([1.0], dims="rung", attrs={"units": "s"})
    whole = xr.Dataset(
        {
            "x": ("phase", np.arange(200.0), {"long_name": "b"}),
            "verdict": ((), 0, {"flag_meanings": "right", "long_name": "b"}),
            "period_time": times,
            "message": "a",
        },
        attrs={"title": "c"},
    )
    whole.to_netcdf(tmp_path / "a.nc")
    kept = data.kept(tmp_path / "a.nc")
    assert set(kept.variables) == {"x", "verdict"} and not kept.attrs and not kept.x.attrs
    assert kept.verdict.attrs == {"flag_meanings": "right"}
    assert kept.x.size <= data.SAMPLES and kept.x[1] == 4.0
    for name in ("a/shard.nc", "times.nc", "work/times_rk4.nc", "work/errors_rk4.nc"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert data.datasets(tmp_path) == ["a.nc", "work/errors_rk4.nc"]


def test_every_row_of_the_table_is_used():
    used = set()
    for name in KNOWN:
        golden = data.read(name)
        used |= {id(tolerance(name, each, golden[each].dtype.kind)) for each in golden.variables}
    assert [names for names, row in TABLE.items() if id(row) not in used] == []
    assert all(row.reason for row in TABLE.values())

"""Figures and studies of the global picture: structure, data, bytes."""

import numpy as np
import pytest
import xarray as xr

from gearlib.data import storage
from gearlib.figures import basins, bifurcation, poincare, style
from gearlib.studies import global_picture as studies
from tests.paper import PARAMETERS

MATERIAL = PARAMETERS | {"material_damping": 3953.7}
BOTH = MATERIAL | {"backlash_damping": 3953.7}
BOX = {"displacement": [-6.0, 6.0], "velocity": [-6.0, 6.0]}


def basin_cases():
    cases = [
        {"title": "three", "tuning": 0.72, "pair": MATERIAL},
        {"title": "two", "tuning": 0.75, "pair": BOTH},
        {"title": "one", "tuning": 1.0, "pair": BOTH},
    ]
    return studies.basin_cases(cases, BOX | {"count": 12, "periods": 200})


def diagrams():
    run = {"settle": 100, "strobes": 8, "starts": 1, "exponent_periods": 40}
    rest = {"samples": 25, "periods": 200}
    return studies.bifurcation(BOTH, np.linspace(0.6, 0.9, 7), [0.7, 0.8], BOX | run | rest)


def sections():
    case = {"phase": 0.0, "settle": 0, "pair": PARAMETERS}
    cases = [{"title": str(nu), "tuning": nu} | case for nu in (0.66, 0.8)]
    return studies.sections(cases, BOX | {"orbits": 6, "periods": 200})


def test_cases_of_different_attractors_share_a_table(tmp_path):
    data = basin_cases()
    assert [int((data.share.sel(case=name) > 0).sum()) for name in data.case.values] == [3, 2, 1]
    np.testing.assert_allclose(data.share.sum("attractor"), 1.0)
    storage.write(data, tmp_path / "basins.nc")
    again = storage.read(tmp_path / "basins.nc")
    np.testing.assert_array_equal(again.basin, data.basin)
    assert again.attractor_kind.attrs["flag_meanings"].split()[0] == "periodic"
    figure = basins.draw(again)
    assert [axes.get_title() for axes in figure.axes] == ["three", "two", "one"]
    legends = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in figure.axes]
    assert [len(words) for words in legends] == [3, 2, 1]
    assert legends[2] == ["period 1: 100.0 ± 0.00 %"]


def test_bifurcation_has_three_panels_and_branches_over_the_first():
    diagram, shares = diagrams()
    assert diagram.direction.values.tolist() == ["up", "down", "cold 1"]
    plain = bifurcation.draw(diagram, shares)
    assert "displacement" in plain.axes[0].get_ylabel()
    assert "Lyapunov" in plain.axes[1].get_ylabel()
    assert plain.axes[2].get_xlabel() == "tuning $\\nu_s$"
    branch = xr.Dataset(
        {
            "tuning": ("point", [0.6, 0.7, 0.8]),
            "state": (("point", "coordinate"), [[0.1, 0.0], [0.2, 0.0], [0.3, 0.0]]),
            "stable": ("point", [1, 1, 0]),
            "branch": ("point", [0, 0, 0]),
        }
    )
    over = bifurcation.draw(diagram, shares, branches=branch)
    words = [text.get_text() for text in over.axes[0].get_legend().get_texts()]
    assert words[-2:] == ["continued, stable", "unstable"]
    dashed = [line for line in over.axes[0].lines if line.get_linestyle() == "--"]
    assert any(np.nanmax(line.get_ydata()) == 0.3 for line in dashed if len(line.get_ydata()))


def test_sections_tell_chaos_from_order():
    data = sections()
    assert 0 < int(data.chaotic.sum()) <= 12
    figure = poincare.draw(data)
    assert all("chaotic" in axes.get_title() for axes in figure.axes)
    assert all("static defl." in axes.get_xlabel() for axes in figure.axes)


@pytest.mark.parametrize(
    "draw",
    [
        lambda: basins.draw(basin_cases()),
        lambda: bifurcation.draw(*diagrams()),
        lambda: poincare.draw(sections()),
    ],
    ids=["basins", "bifurcation", "poincare"],
)
def test_same_data_same_bytes(draw, tmp_path):
    for name in ("a", "b"):
        style.save(draw(), tmp_path / f"{name}.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()

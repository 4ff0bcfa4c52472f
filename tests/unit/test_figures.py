"""Figures of odd data: gaps, single values, no limits; tests/golden has what they hold else.

All are drawn of golden data, with something taken away or changed.
"""

import math

import numpy as np
import pytest

from gearlib.figures import (
    jump_figure,
    nonlinear_damping_figure,
    phase_planes_figure,
    resonance_figure,
    style,
)
from tests.golden import data as golden

EXTREMA = ["displacement_max", "displacement_min"]
CURVES, PLANES = golden.read("resonance.nc"), golden.read("phase_planes.nc")


def gone(data, *names):
    """Return data of which variables have no numbers."""
    return data.assign({name: data[name] * np.nan for name in names})


def jumps():
    data = gone(golden.read("jump.nc"), "jump")
    return data.isel(variation=np.isin(data.kind.values, ["base", "damping"]))


def powers():
    names = [f"nonlinear_damping/{place}_cubic.nc" for place in ("material", "oil")]
    return [gone(golden.read(name), *EXTREMA, "displacement", "velocity") for name in names]


#: Figures of which no limit may be lost.
ODD = {
    "no backlash": lambda: resonance_figure.draw(CURVES.assign(backlash_ratio=0.0)),
    "no far flank": lambda: resonance_figure.draw(CURVES.assign(backlash_ratio=math.inf)),
    "planes without a far flank": lambda: phase_planes_figure.draw(
        PLANES.assign(backlash_ratio=math.inf)
    ),
    "a plane without a result": lambda: phase_planes_figure.draw(
        PLANES.assign(displacement=PLANES.displacement.where(PLANES.damping != "k1"))
    ),
    "no result at a tuning": lambda: resonance_figure.draw(
        CURVES.assign(CURVES[EXTREMA].where(CURVES.tuning > 0.6))
    ),
    "one tuning": lambda: resonance_figure.draw(CURVES.isel(tuning=[4])),
    "no jump": lambda: jump_figure.draw(jumps()),
    "no results": lambda: nonlinear_damping_figure.draw(powers()),
}


@pytest.mark.parametrize("case", ODD)
def test_limits_are_numbers(case):
    for axes in ODD[case]().axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_same_data_same_bytes(tmp_path):
    # tests/robustness compares those of png and pdf.
    paths = [tmp_path / f"{name}.svg" for name in "ab"]
    for path in paths:
        style.save(phase_planes_figure.draw(PLANES), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with pytest.raises(ValueError, match="must end in"):
        style.save(phase_planes_figure.draw(PLANES), tmp_path / "figure.tiff")

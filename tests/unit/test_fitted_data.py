"""Data that a fit refuses, each in one sentence, before any model runs."""

import json

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.uncertainty.observations import observations_of
from tests.paper import PAPER

TIME = np.arange(2000) * 1e-3
COURSE = [[0.0, 1000.0], [2.0, 1200.0]]


def run_up(values=None, time=TIME, known=None, course=COURSE, **attrs):
    """Return made-up data of a run-up; `attrs` are attributes of the displacement.

    `course` are rows of s and rpm, `known` are further known values, or the text in their place.
    """
    values = np.sin(TIME) if values is None else values
    data = xr.Dataset({"displacement": ("sample", values, {"units": "m"} | attrs)})
    known = json.dumps({"course": course} | (known or {})) if not isinstance(known, str) else known
    return data.assign_coords(time=("sample", time)).assign_attrs(known=known)


def sweep(speed=(1e3, 2e3, 3e3), direction=(1, 1, 1), **attrs):
    """Return largest displacements of a sweep."""
    data = xr.Dataset({"displacement_max": ("sample", [1e-5, 2e-5, 3e-5], {"units": "m"} | attrs)})
    coords = {"speed": ("sample", list(speed)), "direction": ("sample", list(direction))}
    return data.assign_coords(coords)


def jump(value, **attrs):
    return xr.Dataset({"jump_up": (np.shape(value) and ("a",), value, attrs)})


SHORT = "time = '0 to 1.999 s' ... within known.course, 0 to 1 s"
SLOW = "time = '0 to 1.999 s' ... more than 12 whole revolutions of known.course, not 0"
#: How the sentence begins ... goes on -> data.
REFUSED = {
    "data = 'ndarray' ... datasets": np.zeros(3),
    "displacement = 'complex128' ... real numbers": run_up(np.sin(TIME) + 0j),
    "displacement = 'of shape (2, 2000)' ... over samples": xr.concat([run_up()] * 2, "run"),
    "time = 'empty'": run_up().isel(sample=slice(0)),
    "time = 'NaN' ... finite": run_up(time=np.where(TIME == 0.0, np.nan, TIME)),
    "time = 'unsorted' ... increasing": run_up(time=TIME[::-1]),
    "noise_std of displacement = -1.0": run_up(noise_std=-1.0),
    "unknown_offset of displacement = 2": run_up(unknown_offset=2),
    "units of displacement = 'mm' ... m, or of unknown gain": run_up(units="mm"),
    "known = '{' ... json": run_up(known="{"),
    "known.course: speed[1][0] = 0.0 ... after 0.0 s": run_up(course=[[0.0, 1e3], [0.0, 2e3]]),
    "known.course: speed[0] = 'f'": run_up(course="fast"),
    "known.options = 'colour' ... one of 'load'": run_up(known={"options": {"colour": 1}}),
    SHORT: run_up(course=[[0.0, 1000.0], [1.0, 1200.0]]),
    "time = '1 to 2.999 s' ... within known.course": run_up(time=1.0 + TIME),
    SLOW: run_up(course=[[0.0, 10.0], [2.0, 12.0]]),
    "speed = -1.0 ... > 0": sweep((-1.0, 2e3, 3e3)),
    "direction = 7 ... one of 1, -1, 0": sweep(direction=(1, 7, 1)),
    "units of displacement_max = 'um' ... m": sweep(units="um"),
    "jump_up = np.float64(nan) ... finite number > 0": jump(np.nan),
    "jump_up = 'of shape (2,)' ... one number": jump([1.0, 2.0]),
    "units of jump_up = 'Hz' ... min-1": jump(50.0, units="Hz"),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_data_that_cannot_be_fitted_are_refused_in_a_sentence(sentence):
    with pytest.raises(ValueError, match="is not allowed") as error:
        gearlib.fit(PAPER, REFUSED[sentence], {"reduced_mass": (2.6, 3.7)})
    begin, *more = sentence.split(" ... ")
    text = str(error.value)
    assert text.startswith(begin) and all(part in text for part in more) and "\n" not in text, text


def test_gain_and_offset_are_eliminated_and_noise_is_single_or_common():
    noise = np.array([1e-7, 2e-7, 3e-7])
    data = sweep(unknown_gain=1, unknown_offset=1, noise_std=2e-7, units="V")
    with_noise = data.assign(displacement_max_noise_std=("sample", noise))
    single, common = (observations_of(PAPER, part)[0].channels[0] for part in (with_noise, data))
    assert single.eliminated == 2 and single.deviations.tolist() == noise.tolist()
    assert common.deviations.tolist() == [2e-7] * 3

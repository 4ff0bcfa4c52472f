"""Turning points of a piece of the motion, a polynomial with known ones."""

import numpy as np
import pytest

from gearlib.models.propagators.record import _Piece, _turning


def found(turning, degree=24):
    """Return the turning points that are found where these are, and a wave beyond the piece."""
    rate = np.polynomial.polynomial.polyfromroots(turning)
    curve = np.zeros((degree, 1))
    curve[1 : rate.size + 1, 0] = rate / np.arange(1, rate.size + 1)
    return _turning(_Piece((), (), None, curve, None, None), 0)


@pytest.mark.parametrize("first", [0.0, 0.11, 0.2, 0.24, 0.5])
@pytest.mark.parametrize("apart", [0.13, 0.2, 0.37])
def test_turning_points_in_neighbouring_stretches(first, apart):
    turning = [first, first + apart]
    # The rate falls through zero as steeply as they are apart.
    assert found(turning) == pytest.approx(turning, abs=1e-15 / apart)


def test_what_turns_beyond_the_piece_is_left_out():
    assert found([-0.01, 0.3, 1.01]) == pytest.approx([0.3], abs=1e-14)
    assert found([-1e-10, 1.0 + 1e-10]) == pytest.approx([0.0, 1.0], abs=1e-9)


def test_a_wave_turns_every_half_period():
    # sin(5 s + 0.3), as its Taylor series.
    phase, terms = 0.3, np.arange(60)
    factorial = np.cumprod(np.maximum(terms, 1.0))
    curve = 5.0**terms / factorial * np.sin(phase + terms * np.pi / 2.0)
    places = _turning(_Piece((), (), None, curve[:, None], None, None), 0)
    assert places == pytest.approx([(np.pi / 2.0 - phase) / 5.0, (1.5 * np.pi - phase) / 5.0])


def test_what_rests_has_no_wrong_turning_points():
    flat = np.zeros((24, 1))
    flat[0] = 1.0
    assert all(0.0 <= s <= 1.0 for s in _turning(_Piece((), (), None, flat, None, None), 0))

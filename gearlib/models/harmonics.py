"""Fourier series over the mesh phase, given by amplitudes or computed from a table."""

import math
from typing import Annotated, Any

from gearlib import checks
from gearlib.parameters import Count, Finite, Values, checked, declared, described


@declared(kw_only=False)
class Harmonics:
    """The sum over n >= 1 of cosines[n - 1] cos(n tau) + sines[n - 1] sin(n tau).

    Raises
    ------
    ValueError
        If an amplitude is not a finite number.
    """

    cosines: Annotated[
        tuple[Finite, ...],
        Values(),
        described("Amplitudes of cosines of orders 1, 2, ... per mesh period"),
    ] = ()
    sines: Annotated[
        tuple[Finite, ...],
        Values(),
        described("Amplitudes of sines; the shorter tuple is filled with zeros"),
    ] = ()

    @classmethod
    @checked
    def from_table(cls, phase: Any, values: Any, count: Count | None = None) -> "Harmonics":
        """Return the harmonics of a table over one mesh period, without its mean.

        Parameters
        ----------
        phase : array_like of float, shape (n,)
            Equidistant mesh phases, rad, in steps of 2 pi / n.
        values : array_like of float, shape (n,)
            Finite values at these phases, continued periodically.
        count : int, optional
            Highest order; by default the highest that the table resolves, (n - 1) // 2.

        Raises
        ------
        ValueError
            If the phases are not equidistant over one period, or a value is not finite.
        """
        # Imported here, because reading the configuration needs no numpy.
        import numpy as np

        from gearlib.data.motions import as_float_array

        phase, values = as_float_array(phase), as_float_array(values)
        n = phase.size
        if phase.shape != values.shape or phase.ndim != 1 or n < 3:
            raise ValueError(
                f"phase of shape {phase.shape} and values of shape {values.shape} are not "
                "allowed: they must be equally long sequences of at least 3 numbers"
            )
        if not np.allclose(np.diff(phase), 2.0 * math.pi / n, rtol=1e-6):
            raise ValueError(
                f"phase = {phase[0]!r} ... {phase[-1]!r} is not allowed: it must rise in equal "
                f"steps of 2 pi / {n} over one mesh period, without the end of the period"
            )
        checks.require(np.isfinite(values).all(), "values", values, "finite")
        max_count = (n - 1) // 2
        if count is None:
            count = max_count
        checks.require(count <= max_count, "count", count, f"an integer from 1 to {max_count}")
        # The factor exp(-i n phase[0]) refers the spectrum to phase 0 instead of the first phase.
        orders = np.arange(1, count + 1)
        spectrum = np.fft.rfft(values)[1 : count + 1] * 2.0 / n * np.exp(-1j * orders * phase[0])
        return cls(tuple(spectrum.real.tolist()), tuple((-spectrum.imag).tolist()))

    def table(self, scale: float = 1.0) -> Any:
        """Return an array of rows (order, cosine amplitude, sine amplitude), shape (n, 3).

        The orders are 1 to n, where n is the length of the longer of the tuples `cosines` and
        `sines`; missing amplitudes are 0. All amplitudes are multiplied by `scale`.
        """
        import numpy as np  # Imported here, because reading the configuration needs no numpy.

        n = max(len(self.cosines), len(self.sines))
        rows = np.zeros((n, 3), np.result_type(float, scale))
        rows[:, 0] = np.arange(1, n + 1)
        rows[: len(self.cosines), 1] = self.cosines
        rows[: len(self.sines), 2] = self.sines
        rows[:, 1:] *= scale
        return rows

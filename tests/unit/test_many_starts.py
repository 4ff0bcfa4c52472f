"""What many starts have in common."""

import numpy as np
import xarray as xr

from gearlib.studies.many_starts import over_starts


def test_a_start_that_could_not_go_on_does_not_hide_the_others():
    values = [[1.0, np.nan], [np.nan, np.nan], [3.0, np.nan], [4.0, np.nan]]
    found = over_starts(xr.Dataset({"x": (("start", "model"), values)}), ["x"])
    assert [float(found[f"x{end}"][0]) for end in ("", "_low", "_high")] == [3.0, 1.0, 4.0]
    assert all(np.isnan(found[f"x{end}"][1]) for end in ("", "_low", "_high"))

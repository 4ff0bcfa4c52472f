"""Compile the kernels of Taylor series and of matrices; the stamp file identifies the sources."""

from pathlib import Path

from gearlib.engines.cache import source_hash
from gearlib.engines.orbit import Span
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from job import redirect_output


def run(model):
    """Compile the kernels of a model by a run of two mesh periods and the period maps."""
    propagator = model.propagator(0.9)
    start = propagator.initial_state((0.0, 0.0))
    propagator.run(start, Span(2, 1, 100), keep_events=False)
    propagator.maps(start, 1, 100)


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair.from_ratios(contact_ratio=1.6, stiffness_ratio=0.6, backlash=4.0)
    run(OneDegreePair(pair=pair, cubic_damping=1.0))  # Taylor series
    gears = {"base_radii": (1.0,) * 2, "inertias": (2.0,) * 2, "masses": (5.0,) * 2}
    run(SixDegreePair(pair=pair, bearing_stiffness=(0.1,) * 4, **gears))  # matrices
    Path(snakemake.output.stamp).write_text(f"{source_hash()}\n", encoding="utf-8")

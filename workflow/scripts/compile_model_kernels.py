"""Compile the kernels of the engine matrix or taylor, and write the hash of the sources."""

from pathlib import Path

from gearlib.engines.jit import source_hash
from gearlib.engines.orbit import Span
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Harmonics
from job import redirect_output

#: Engine -> arguments of the smallest model that needs this engine.
MODELS = {"matrix": {"deviation": Harmonics((1e-6,))}, "taylor": {"cubic_damping": 1.0}}

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair.from_ratios(contact_ratio=1.6, stiffness_ratio=0.6, backlash_ratio=4.0)
    model = OneDegreePair(pair=pair, **MODELS[snakemake.wildcards.engine])
    propagator = model.propagator(0.9)
    start = propagator.initial_state((0.0, 0.0))
    propagator.run(start, Span(2, 1, 100), keep_events=False)
    propagator.maps(start, 1, 100)
    Path(snakemake.output.stamp).write_text(f"{source_hash()}\n", encoding="utf-8")

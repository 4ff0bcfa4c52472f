"""Compute the chart of parametric resonance."""

from joblog import redirect_output
from gearlib.analysis.tongues import chart
from gearlib.data import storage
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    tunings = grid(*(settings.pop(key) for key in ("start", "stop", "step")))
    dataset = chart.compute(snakemake.params.pair, tunings, settings)
    storage.write(dataset, snakemake.output.dataset)

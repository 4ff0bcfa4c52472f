"""Compute the phase lag."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import phase_lag
from gearlib.tunings import grid


def compute(pair, lag, samples_per_period):
    """Return the courses and lags that the configuration asks for."""
    return phase_lag.compute(
        pair,
        lag["material_dampings"],
        lag["tuning"],
        grid(lag["start"], lag["stop"], lag["step"]),
        harmonics=lag["harmonics"],
        periods=lag["periods"],
        samples_per_period=samples_per_period,
    )


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = compute(
        snakemake.params.pair,
        snakemake.params.lag,
        snakemake.params.samples_per_period,
    )
    storage.write(dataset, snakemake.output.dataset)

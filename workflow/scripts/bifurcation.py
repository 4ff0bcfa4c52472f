"""Compute the bifurcation diagram, its Lyapunov exponents and the shares of the basins."""

from joblog import redirect_output
from gearlib.analysis.global_dynamics import studies
from gearlib.data import storage
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    diagram, shares = studies.bifurcation(
        snakemake.params.pair,
        grid(settings["start"], settings["stop"], settings["step"]),
        grid(settings["start"], settings["stop"], settings["share_step"]),
        settings,
        threads=snakemake.threads,
    )
    storage.write(diagram, snakemake.output.diagram)
    storage.write(shares, snakemake.output.shares)

"""Compile the kernels of gear trains; the stamp file identifies the sources."""

from pathlib import Path

from compile_larger_kernels import run
from gearlib.engines.cache import source_hash
from gearlib.models.trains.planetary import planetary
from job import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    run(planetary(stiffness_ratio=(0.8, 0.8)))
    Path(snakemake.output.stamp).write_text(f"{source_hash()}\n", encoding="utf-8")

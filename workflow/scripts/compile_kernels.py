"""Compile the kernels of gear pairs to the cache, and write the hash of their sources to a file."""

from pathlib import Path

from gearlib import engines
from job import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    Path(snakemake.output.stamp).write_text(f"{engines.warm_up()}\n", encoding="utf-8")

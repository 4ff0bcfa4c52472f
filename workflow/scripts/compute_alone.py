"""Compute the results of a rule that measures wall times."""

import one_thread  # noqa: F401
from compute import main

if __name__ == "__main__":
    main(snakemake)

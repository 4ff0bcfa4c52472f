"""Compute the results of a rule that measures wall times, with linear algebra in one thread."""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

from compute import main  # noqa: E402 - numpy reads the variables when it is loaded

if __name__ == "__main__":
    main(snakemake)

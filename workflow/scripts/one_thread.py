"""Linear algebra on one thread, for jobs that measure wall times; imported before numpy."""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

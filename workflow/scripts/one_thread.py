"""Linear algebra on one thread, in jobs that measure wall times: their cores are for being alone.

Imported before numpy, which reads this once.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

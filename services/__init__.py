"""The processes of Heel, and the command that runs them."""

import os

# Read when NumPy and SciPy are loaded, hence here. Four processes share the cores already: threads
# inside BLAS only take turns, spinning (60 frames of TownCentre-A in the tracker: 2.4 s of
# processor time with them, 1.4 s without, and 0.2 s less at the start of every process).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

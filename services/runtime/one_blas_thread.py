"""Imported first by every process of Heel, before NumPy and SciPy are loaded, which read it then.

Several processes share the cores already: threads inside BLAS only take turns, spinning (60 frames
of TownCentre-A in the tracker: 2.4 s of processor time with them, 1.4 s without, and 0.2 s less at
the start of every process). A program that imports `heel` keeps what it has chosen itself.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

"""The solver alone is scipy's own, and a tracker starts without what stands beside it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from scipy.optimize import linear_sum_assignment

from heel.services.geometry import assignment


def test_the_solver_alone_gives_what_scipy_gives() -> None:
    rng = np.random.default_rng(4)
    for shape in ((1, 1), (3, 5), (5, 3), (0, 4), (12, 12)):
        for costs in (rng.normal(size=shape), rng.integers(0, 3, shape).astype(float)):
            for maximize in (False, True):
                own = assignment.linear_sum_assignment(costs, maximize=maximize)
                whole = linear_sum_assignment(costs, maximize=maximize)
                assert all(np.array_equal(a, b) for a, b in zip(own, whole, strict=True))


def test_a_tracker_imports_nothing_else_of_it() -> None:
    told = "import sys, heel.services.tracker.service; print('scipy.optimize' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

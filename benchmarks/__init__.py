"""Speed, latency and memory: always against something, medians of interleaved runs."""

from heel.services.runtime import one_blas_thread  # noqa: F401  # as in the processes

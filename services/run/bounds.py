"""How often a service is started again before it stays down, in runs and in systemd's units."""

from __future__ import annotations

MOST_STARTS = 5
"""Within `WITHIN_S`: a service that cannot run at all gets there in ten seconds; chosen by hand."""
WITHIN_S = 60.0
"""See `MOST_STARTS`; seconds, chosen by hand."""

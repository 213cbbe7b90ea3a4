"""The documentation site: what is made from the code, and the extension that puts it into pages."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]

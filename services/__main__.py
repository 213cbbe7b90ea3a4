"""`python -m services`: the `heel` command, where it is not on the path."""

from __future__ import annotations

from services.cli import main

if __name__ == "__main__":
    main()

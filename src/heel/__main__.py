"""`heel`, and `python -m heel` where it is not on the path."""

from heel.services.runtime.interrupts import interrupts_end


def main() -> None:
    """Entry point of the `heel` command."""
    with interrupts_end():
        from heel.services.cli import main as run
    run()


if __name__ == "__main__":
    main()

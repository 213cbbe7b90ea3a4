"""`heel`, and `python -m heel` where it is not on the path."""

import signal


def main() -> None:
    """Entry point of the `heel` command."""
    # Until all is imported, which takes a second, Ctrl-C ends this process as it would any other,
    # without a traceback through somebody's imports. Where it is ignored it stays ignored.
    own = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if own:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from heel.services.cli import main as run

    if own:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


if __name__ == "__main__":
    main()

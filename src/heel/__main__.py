"""`python -m heel`: the `heel` command, where it is not on the path."""

from heel.services.cli import main

if __name__ == "__main__":
    main()

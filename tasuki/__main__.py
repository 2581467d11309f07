"""`tasuki`, and `python -m tasuki`."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C is quiet even while it is being imported."""
    try:
        from tasuki.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()

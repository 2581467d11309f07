"""`python -m tasuki`: the command line."""

from tasuki.cli import main

main()

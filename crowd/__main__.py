"""`python -m crowd`."""

from crowd.cli import main

main()

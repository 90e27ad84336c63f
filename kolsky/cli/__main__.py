"""`python -m kolsky.cli`."""

from kolsky.cli.commandline import main

main()

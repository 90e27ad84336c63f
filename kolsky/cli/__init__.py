"""The command line, `kolsky`: a file a command, with its options and what is done with them."""

from kolsky.cli.commandline import app, main

__all__ = ["app", "main"]

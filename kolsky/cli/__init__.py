"""The command line, `kolsky`: one file per command, with its options and actions."""

from kolsky.cli.commandline import app, main

__all__ = ["app", "main"]

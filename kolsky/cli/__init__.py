"""The command line, `kolsky`: the typed options of every command, and nothing that computes."""

from kolsky.cli.commandline import app, main

__all__ = ["app", "main"]

"""What --help prints is what was written: rich text takes a word in square brackets for a style."""

import typer
from rich.text import Text

from kolsky.cli.commandline import app


def texts(command: object, name: str) -> list[tuple[str, str]]:
    """Every text of a command and of the commands below it, with where it stands."""
    found = [(name, getattr(command, "help", None) or "")]
    for parameter in getattr(command, "params", []):
        found.append((f"{name} {parameter.name}", getattr(parameter, "help", None) or ""))
    for below, part in getattr(command, "commands", {}).items():
        found += texts(part, f"{name} {below}")
    return found


def test_no_word_of_a_help_text_is_lost() -> None:
    said = texts(typer.main.get_command(app), "kolsky")
    assert len(said) > 100  # all commands and options were found
    lost = {place: text for place, text in said if Text.from_markup(text).plain != text}
    assert not lost

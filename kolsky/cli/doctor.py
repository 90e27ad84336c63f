"""`kolsky doctor`: what this installation has to work with."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.options import AsJson


def doctor(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where shots are, to see whether results can go there.")
    ] = Path(),
    as_json: AsJson = False,
) -> None:
    """Show versions, devices, the cache of compiled kernels, what can be read, and whether one may write.

    Ends with exit code 1 if something that every command needs is missing.
    """
    from kolsky.base.json_types import jsonable
    from kolsky.cli.installation import examine
    from kolsky.cli.terminal import print_result

    found = examine(folder)
    said = jsonable(found.as_dict(), "doctor") if as_json else None
    print_result(found.rows(), said, rest={}, warnings=found.problems)
    if found.problems:
        raise typer.Exit(1)

"""Options that every command has."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import typer

from kolsky.cli.quiet import quietly

Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="No progress, no wall time: the answer and its warnings alone."),
]


def with_general_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that every command has.

    Parameters
    ----------
    command
        A function of typed options.
    """
    hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints.get(parameter.name, parameter.annotation))
        for parameter in inspect.signature(command).parameters.values()
    ]

    @functools.wraps(command)
    def spread(*, quiet: bool = False, **given: Any) -> None:
        with quietly(quiet):
            command(**given)

    added = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
    spread.__signature__ = inspect.Signature([*own, added])  # type: ignore[attr-defined]
    spread.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, added)}
    del spread.__wrapped__  # type: ignore[attr-defined]
    return spread

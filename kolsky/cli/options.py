"""Options of the commands, made from the settings that they fill (`with_settings`); the shot of a command."""

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import typer

from kolsky.base.errors import refused
from kolsky.base.files import usable_folder
from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.terminal import printing, progress_bars

if TYPE_CHECKING:
    from kolsky.pictures.picture_set import PictureSet
    from kolsky.shot.records import OpticalData, Shot


ShotPath = Annotated[Path, typer.Argument(metavar="SHOT", help="A shot's folder, or its shot.toml.")]
Out = Annotated[Path | None, Option("Where results go.", metavar="FOLDER", show_default="SHOT/results")]
OutFolder = Annotated[Path, Option("Where results go.", metavar="FOLDER")]
Figures = Annotated[
    tuple[str, ...],
    Option(
        "Also save each figure as a file, e.g. pdf,svg,png,csv.",
        metavar="FORMATS",
        show_default="",
        read=texts.figure_formats,
    ),
]
Values = Annotated[
    dict[str, float],
    Option("Hold a parameter at this value (SI or with unit).", short="-p", metavar="NAME=VALUE"),
]
Vtu = Annotated[bool, Option("Also write meshes for ParaView.")]

READERS: tuple[tuple[Any, Callable[[str, Any], Any]], ...] = (
    (tuple[int, int], texts.mesh),
    (dict[str, float], texts.values),
    (Mapping[str, tuple[float, float] | None], texts.ranges),
    (tuple[str, ...], lambda option, given: tuple(given)),
    (tuple[Path, ...], lambda option, given: tuple(given)),
)
"""Conversion of the text of an option, by its type. All options but a mesh may be repeated."""


class _Argument(NamedTuple):
    """One option of a command: annotation and default for typer, and the conversion of its text."""

    annotation: Any
    default: Any
    read: Callable[[Any], Any]


def _argument(name: str, hint: Any, default: Any) -> _Argument:
    """The option of a field or parameter. An annotation for typer does not change."""
    option = _option_of(hint)
    if option is None:
        return _Argument(hint, default, lambda given: given)
    kind = get_args(hint)[0]
    bare = (
        next((part for part in get_args(kind) if part is not type(None)), kind) if _optional(kind) else kind
    )
    flag = f"--{_word(name, option, default)}"
    shown: dict[str, Any] = {"help": option.help, "metavar": option.metavar, "rich_help_panel": option.panel}
    if option.show_default is not None:
        shown["show_default"] = option.show_default or False
    names = [flag, *option.short.split("/")] if option.short else [flag]
    if bare is bool or option.on is not None:
        on = option.on or (lambda: not default)
        return _Argument(
            Annotated[bool, typer.Option(*names, help=option.help, rich_help_panel=option.panel)],
            False,
            lambda given: on() if given else default,
        )
    read = _reader(bare, option)
    if read is None:
        shown |= {"min": option.min, "max": option.max}
        return _Argument(Annotated[kind, typer.Option(*names, **shown)], default, lambda given: given)
    missing = None if default is inspect.Parameter.empty else default
    if option.read is None and get_origin(bare) in (dict, Mapping, tuple) and bare != tuple[int, int]:
        each = Path if bare == tuple[Path, ...] else str
        required = bare == dict[str, float]
        return _Argument(
            Annotated[list[each] | None, typer.Option(*names, **shown)],  # type: ignore[valid-type]
            None,
            lambda given: read(flag, given or []) if given or required else missing,
        )
    text = _text(default, bare)
    return _Argument(
        Annotated[str if text is not None else str | None, typer.Option(*names, **shown)],
        inspect.Parameter.empty if default is inspect.Parameter.empty else text,
        lambda given: missing if given in (text, *([""] if text is None else [])) else read(flag, given),
    )


def _optional(kind: Any) -> bool:
    return type(None) in get_args(kind)


def _option_of(hint: Any) -> Option | None:
    """The option in an annotation."""
    return next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, Option)), None)


def _reader(kind: Any, option: Option) -> Callable[[str, Any], Any] | None:
    """Function that converts the text of an option. None if typer converts it."""
    if option.read is not None:
        return option.read
    if option.unit:
        return functools.partial(texts.physical, unit=option.unit, positive=option.positive)
    if get_origin(kind) is Literal:
        return functools.partial(texts.one_of, choices=[word for word in get_args(kind) if word])
    return next((read for one, read in READERS if one == kind), None)


def _text(default: Any, kind: Any) -> str | None:
    """Text of a default value on the command line."""
    if default is None or default is inspect.Parameter.empty:
        return None
    if isinstance(default, tuple):
        words = [f"{part:g}" if isinstance(part, float) else str(part) for part in default]
        return ("x" if kind == tuple[int, int] else ",").join(words)
    return str(default)


def _arguments(name: str, hint: Any, default: Any) -> dict[str, _Argument]:
    """The options of a parameter: one, or those of its record's fields."""
    kind, chosen = _record(hint)
    if kind is None:
        return {name: _argument(name, hint, default)}
    arguments: dict[str, _Argument] = {}
    for field, annotation in _option_fields(kind, chosen):
        field_default = (
            (field.default if field.default_factory is MISSING else field.default_factory())
            if default is inspect.Parameter.empty
            else getattr(default, field.name)
        )
        arguments |= _arguments(field.name, annotation, field_default)
    return arguments


def _made(name: str, hint: Any, default: Any, values: Mapping[str, Any]) -> Any:
    """The value of a parameter: one of the values, or a record of several."""
    kind, chosen = _record(hint)
    if kind is None:
        return values[name]
    base = kind() if default is inspect.Parameter.empty else default
    parts = {
        field.name: _made(field.name, annotation, getattr(base, field.name), values)
        for field, annotation in _option_fields(kind, chosen)
    }
    with texts.refused(cure="correct the option; `--help` shows each with its range"):
        return replace(base, **parts)


def _record(hint: Any) -> tuple[Any, tuple[str, ...]]:
    """The dataclass of an annotation, None if it is not a record, and the names of fields to use."""
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    chosen = next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, tuple)), ())
    return (kind if is_dataclass(kind) else None), chosen


def _option_fields(kind: Any, chosen: tuple[str, ...]) -> Iterator[tuple[Field[Any], Any]]:
    """The fields of a record that are options or records of options."""
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint = hints[field.name]
        if field.name in (chosen or hints) and (_option_of(hint) or _record(hint)[0] is not None):
            yield field, hint


def changed(record: Any) -> dict[str, bool]:
    """For the name of each option of a record, True if its value differs from the default."""
    return {
        f"--{_word(field.name, option, field.default)}": getattr(record, field.name) != field.default
        for field, hint in _option_fields(type(record), ())
        if (option := _option_of(hint)) is not None
    }


def _word(name: str, option: Option, default: Any) -> str:
    """Name of an option without its dashes. A switch that is on by default is turned off by "no-"."""
    word = option.name or name.replace("_", "-")
    return f"no-{word}" if default is True else word


_PRINTING: dict[str, Any] = {
    "as_json": Annotated[bool, Option("Print one JSON object (SI units) instead of a table.", name="json")],
    "quiet": Annotated[
        bool, Option("Print the answer and its warnings only: no progress, no wall time.", short="-q")
    ],
}
"""Options of every command."""


def with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Make one option from every setting of a command, and add `--json` and `--quiet`.

    A parameter of the command is annotated by `typer.Argument`, by an `kolsky.base.options.Option`, or is a
    record with such fields, such as `kolsky.inverse.settings.Numerics`. The fields replace the record in the
    signature. ``Annotated[Record, ("field", ...)]`` uses only these fields.
    """
    hints = get_type_hints(command, include_extras=True)
    given = inspect.signature(command).parameters
    arguments: dict[str, _Argument] = {}
    for name, parameter in given.items():
        arguments |= _arguments(name, hints[name], parameter.default)
    of_command = tuple(arguments)
    arguments |= {name: _argument(name, hint, False) for name, hint in _PRINTING.items()}

    @functools.wraps(command)
    def spread(*, as_json: bool = False, quiet: bool = False, **texts_given: Any) -> None:
        with printing(as_json=as_json, quiet=quiet):
            values = {
                name: arguments[name].read(texts_given.get(name, arguments[name].default))
                for name in of_command
            }
            command(
                **{
                    name: _made(name, hints[name], parameter.default, values)
                    for name, parameter in given.items()
                }
            )

    spread.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=one.annotation
            )
            for name, one in arguments.items()
        ]
    )
    spread.__annotations__ = {name: one.annotation for name, one in arguments.items()}
    del spread.__wrapped__  # type: ignore[attr-defined]
    return spread


def load(
    shot: Path, out: Path | None, *inside: str, forks: bool = True, device: str = "cpu"
) -> "tuple[Shot, Path]":
    """The shot and the folder of its results, which is checked before any work.

    ``out``: by default the folder "results" of the shot. ``inside``: folders inside it. ``forks``: True if
    several processes may correlate pictures. ``device``: where pictures are correlated. Raises InputError if
    the shot or the folder cannot be used.
    """
    from kolsky.schema.shot_file import folder_of
    from kolsky.shot.load import load_shot

    place = out or folder_of(shot) / "results"

    def measure(pictures: "PictureSet") -> "OpticalData":
        from dic.processes import allow_forks
        from kolsky.base.process import keep_freed_memory
        from kolsky.shot.optical_data import measured

        keep_freed_memory()
        with progress_bars() as progress, allow_forks() if forks else nullcontext():
            return measured(pictures, usable_folder(place), device=device, progress=progress)

    loaded = load_shot(shot, measure=measure)
    return loaded, usable_folder(place.joinpath(*inside))


def usable(shot: "Shot") -> AbstractContextManager[None]:
    """Context that turns errors of an unusable shot into bad input: one line, exit code 2."""
    cure = "correct shot.toml or the option that it names; `kolsky check` shows what was read"
    return refused(shot.folder, cure=cure)

"""Pydantic models in the API: types without the functions that read them, and the default of every field."""

from functools import reduce
from operator import or_
from types import UnionType
from typing import Annotated, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

_defaults: dict[str, str] = {}
"""Sentence on the default by the dotted name of a field."""


def bare(annotation):
    """A type without the validators and bounds of `Annotated`, inside containers too."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return bare(parts[0])
    if origin in (Union, UnionType):
        return reduce(or_, map(bare, parts))
    if origin is None or origin is Literal:
        return annotation
    return origin[tuple(part if part is ... else bare(part) for part in parts)]


def plain_types(app, what, name, obj, skip, options):
    """Remove the validators from the types of a model before autodoc writes its fields; skip its settings.

    Autodoc first asks for every member of a module whether to skip it, and then documents it.
    """
    if isinstance(obj, type) and issubclass(obj, BaseModel) and obj is not BaseModel:
        for field, info in obj.model_fields.items():
            if field in obj.__annotations__:
                obj.__annotations__[field] = bare(info.annotation)
            if info.is_required():
                said = "Has to be given."
            elif info.default is PydanticUndefined:  # created for each model
                said = f"Default: ``{info.default_factory.__name__}()``."
            else:
                said = f"Default: ``{info.default!r}``."
            _defaults[f"{obj.__module__}.{obj.__qualname__}.{field}"] = said
    return True if name == "model_config" else None


def add_default(app, what, name, obj, options, lines):
    """Append the default of a field to its docstring."""
    if name in _defaults and lines:
        lines += ["", _defaults[name], ""]


def setup(app):
    """Register both hooks."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-skip-member", plain_types)
    app.connect("autodoc-process-docstring", add_default)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Values as JSON types."""

import math
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np


def jsonable(value: Any, where: str) -> Any:
    """A value as JSON types: arrays and tuples as lists, enums as text, numbers that are not finite as null.

    Raises
    ------
    TypeError
        If something in it has no such form; the message names its place, starting from `where`.
    """
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, str) else value.name
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist(), where)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): jsonable(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item, f"{where}[{number}]") for number, item in enumerate(value)]
    raise TypeError(f"{where} is a {type(value).__name__}; JSON has numbers, texts, lists and objects only")

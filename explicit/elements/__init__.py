"""Elements, one file each; a new element is one file and one line of `ELEMENTS`."""

from explicit.elements.base import Element, ElementFunctions
from explicit.elements.fbar import FBar
from explicit.elements.one_point import OnePoint

ELEMENTS: dict[str, Element] = {item.name: item for item in (OnePoint(), FBar())}

__all__ = ["ELEMENTS", "Element", "ElementFunctions", "element"]


def element(name: str) -> Element:
    """Look an element up by name; a ValueError lists those there are if it is none."""
    if name not in ELEMENTS:
        raise ValueError(f"element must be one of {sorted(ELEMENTS)}, got {name!r}")
    return ELEMENTS[name]

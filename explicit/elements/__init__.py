"""Elements, one file each. A new element is one file and one entry of `ELEMENTS`."""

from explicit.elements.base import Element, ElementFunctions
from explicit.elements.fbar import FBar
from explicit.elements.one_point import OnePoint

ELEMENTS: dict[str, Element] = {item.name: item for item in (OnePoint(), FBar())}

__all__ = ["ELEMENTS", "Element", "ElementFunctions", "element"]


def element(name: str) -> Element:
    """The element of a name; raises ValueError with the valid names if there is none."""
    if name not in ELEMENTS:
        raise ValueError(f"element must be one of {sorted(ELEMENTS)}, got {name!r}")
    return ELEMENTS[name]

"""Elements by name; `implicit.elements.reference` says what one is.

To add one write an `Element` (its nodes in reference coordinates and the monomials that its shape functions
span) and one line in `ELEMENTS`; the patch tests go over the registry.
"""

from implicit.elements.hypercubes import HEX8, HEX27, QUAD4, QUAD8, QUAD9
from implicit.elements.reference import Element
from implicit.elements.simplices import TET4, TET10, TRI3, TRI6

ELEMENTS: dict[str, Element] = {
    element.name: element for element in (TRI3, TRI6, QUAD4, QUAD8, QUAD9, TET4, TET10, HEX8, HEX27)
}


def element(name: str) -> Element:
    """Look an element up by name.

    Raises
    ------
    ValueError
        If there is no such element; the message lists those there are.
    """
    if name not in ELEMENTS:
        raise ValueError(f"kind must be one of {sorted(ELEMENTS)}, got {name!r}")
    return ELEMENTS[name]

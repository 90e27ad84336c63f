"""Contact laws between a node and a rigid platen; a new law is a class and an entry of `CONTACT_LAWS`."""

from explicit.contact.base import ContactLaw
from explicit.contact.laws import Bonded, BondedRelease, Coulomb, Frictionless, Penalty, Rough

CONTACT_LAWS: dict[str, ContactLaw] = {
    law.name: law for law in (Bonded(), BondedRelease(), Rough(), Coulomb(), Frictionless(), Penalty())
}

__all__ = ["CONTACT_LAWS", "ContactLaw", "contact_law"]


def contact_law(name: str) -> ContactLaw:
    """Find a contact law by name; raises ValueError with the valid names if there is none."""
    if name not in CONTACT_LAWS:
        raise ValueError(f"contact law must be one of {sorted(CONTACT_LAWS)}, got {name!r}")
    return CONTACT_LAWS[name]

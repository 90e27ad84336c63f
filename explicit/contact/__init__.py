"""Contact laws, one file each; a new law is one file and one line of `CONTACT_LAWS`."""

from explicit.contact.base import ContactLaw
from explicit.contact.bonded import Bonded
from explicit.contact.bonded_release import BondedRelease
from explicit.contact.coulomb import Coulomb
from explicit.contact.frictionless import Frictionless
from explicit.contact.penalty import Penalty
from explicit.contact.rough import Rough

CONTACT_LAWS: dict[str, ContactLaw] = {
    law.name: law for law in (Bonded(), BondedRelease(), Rough(), Coulomb(), Frictionless(), Penalty())
}

__all__ = ["CONTACT_LAWS", "ContactLaw", "contact_law"]


def contact_law(name: str) -> ContactLaw:
    """Look a contact law up by name; a ValueError lists those there are if it is none."""
    if name not in CONTACT_LAWS:
        raise ValueError(f"contact law must be one of {sorted(CONTACT_LAWS)}, got {name!r}")
    return CONTACT_LAWS[name]

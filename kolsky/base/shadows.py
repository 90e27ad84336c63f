"""The top-level packages have short names. Another distribution may have the same names."""

import warnings
from importlib.util import find_spec
from pathlib import Path

OURS = ("dic", "doe", "explicit")
"""Top-level packages that are installed with `kolsky`."""


def shadowed() -> list[str]:
    """One sentence for each of these packages that Python would import from another place."""
    folder = Path(__file__).resolve().parents[2]
    said = []
    for name in OURS:
        found = find_spec(name)
        places = [] if found is None else list(found.submodule_search_locations or [str(found.origin)])
        if [Path(str(place)).resolve() for place in places] != [folder / name]:
            where = "nowhere" if found is None else f"at {', '.join(map(str, places))}"
            said.append(
                f"the package {name} of kolsky should be at {folder / name}, but Python finds it {where}: "
                f"another distribution has that name; install kolsky in a separate environment"
            )
    return said


def warn_of_shadows() -> None:
    """Issue one warning for each package that `shadowed` reports."""
    for line in shadowed():
        warnings.warn(line, UserWarning, stacklevel=3)

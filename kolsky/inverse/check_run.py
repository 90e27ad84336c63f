"""The check run of an identification, known before the uncertainty of the answer is: what may be shown of it
meanwhile."""

from dataclasses import dataclass
from typing import Any, Protocol

from explicit import Response
from kolsky.inverse.result import Comparison, Identification


class ShowsCheckRun(Protocol):
    """What tells of a check run: a `CheckRun`, or the `Identification` that it becomes part of."""

    @property
    def comparison(self) -> Comparison:
        """The run beside the data."""
        ...

    @property
    def response(self) -> Response:
        """The run itself."""
        ...

    @property
    def refined_mesh(self) -> tuple[int, int]:
        """Its mesh."""
        ...

    @property
    def provenance(self) -> dict[str, Any]:
        """Input hashes, settings, versions."""
        ...


@dataclass(frozen=True)
class CheckRun:
    """The check run at the answer on the refined mesh, each field as of `Identification`."""

    comparison: Comparison
    """The run beside the data."""
    response: Response
    """The run itself, with all nodes."""
    refined_mesh: tuple[int, int]
    """Elements across the radius and along the length."""
    provenance: dict[str, Any]
    """Input hashes, settings, versions."""

    def is_of(self, found: Identification) -> bool:
        """Whether an identification has this very run, and not another one with the same numbers."""
        return all(getattr(found, name) is getattr(self, name) for name in self.__dataclass_fields__)

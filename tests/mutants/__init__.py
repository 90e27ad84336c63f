"""Named faults of a few tokens, each with the quick tests that must fail when it is planted.

``python -m tests.mutants`` plants every fault in a copy of the sources, one at a time, and runs its tests
there. If all tests pass, a test is missing. Each subject has one table of faults in ``faults/``. `Fault`
explains their keys. ``tests`` of a fault is a list, or the name of a list in the table ``tests`` of its
subject.
"""

import tomllib
from pathlib import Path
from typing import Any

from tests.mutants.fault import Fault

__all__ = ["FAULTS", "Fault"]


def _faults(subject: Path) -> tuple[Fault, ...]:
    table = tomllib.loads(subject.read_text("utf-8"))

    def fault(tests: str | list[str], **said: Any) -> Fault:
        return Fault(**said, tests=tuple(table["tests"][tests] if isinstance(tests, str) else tests))

    return tuple(fault(**said) for said in table["faults"])


FAULTS: tuple[Fault, ...] = tuple(
    fault
    for subject in sorted((Path(__file__).parent / "faults").glob("*.toml"))
    for fault in _faults(subject)
)

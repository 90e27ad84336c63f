"""How long the stages take."""

from collections.abc import Callable
from time import perf_counter
from typing import TypeVar

Result = TypeVar("Result")


class Clock:
    """Wall time of the stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        """Of each stage that ended, by its name [s]."""

    def __call__(self, stage: str, work: Callable[[], Result]) -> Result:
        """Do the work of a stage; what it raises, it raises, and has no time."""
        started = perf_counter()
        result = work()
        self.seconds[stage] = perf_counter() - started
        return result

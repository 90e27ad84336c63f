"""One fault: a line of source changed, and the tests that must notice."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A change of one line of source that quick tests must notice."""

    name: str
    """What is wrong then, in words; unique."""
    file: str
    """Source file, relative to the repository."""
    right: str
    """Text of the file that is changed; stands in it exactly once."""
    wrong: str
    """What stands there instead."""
    tests: tuple[str, ...]
    """Tests of which at least one must fail, as pytest takes them: ``file`` or ``file::test``."""

    def planted(self, source: str) -> str:
        """The source with the fault in it.

        Raises
        ------
        ValueError
            If the right text does not stand in it exactly once, or nothing would change.
        """
        times = source.count(self.right)
        if times != 1:
            raise ValueError(f"{self.name}: {self.right!r} stands {times} times in {self.file}, not once")
        if self.right == self.wrong:
            raise ValueError(f"{self.name}: nothing changes")
        return source.replace(self.right, self.wrong)

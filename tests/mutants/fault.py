"""One fault: a change of a few tokens of a function, and the tests that must detect it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A change of a few tokens of source that quick tests must notice."""

    name: str  # Text: the error that the fault causes; unique
    function: str
    """Innermost function, class or constant that the change lies in, as ``Class.method``, without its
    module; ``__main__`` is what a module does as a program."""
    right: str  # code that is changed. Its tokens occur in the function exactly once, with any line breaks.
    wrong: str  # the replacement
    tests: tuple[str, ...]
    """Tests of which at least one must fail, as pytest takes them: ``file`` or ``file::test``."""
    near: str = ""
    """Other code, where several places are called so and the right code stands in more than one of them: of
    the same function, or of the same module if it is a constant."""

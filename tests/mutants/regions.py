"""Faults of regions by hand: what is refused, and what is left of the file."""

from tests.mutants.fault import Fault

TESTS = ("tests/unit/shot/test_regions_by_hand.py",)
SHAPES = "kolsky/pictures/regions.py"
SERVER = "kolsky/pictures/region_server.py"

FAULTS = (
    Fault(
        name="regions: half a pixel outside the picture is let through",
        file=SHAPES,
        right="0.0 <= y <= rows - 1.0",
        wrong="-0.5 <= y <= rows - 1.0",
        tests=TESTS,
    ),
    Fault(
        name="regions: a polygon's area taken twice",
        file=SHAPES,
        right="float(0.5 * abs(",
        wrong="float(1.0 * abs(",
        tests=TESTS,
    ),
    Fault(
        name="regions: sides that cross are not seen",
        file=SHAPES,
        right="if s[0] * s[1] < 0.0 and s[2] * s[3] < 0.0:",
        wrong="if s[0] * s[1] < 0.0 and s[2] * s[3] < -1e9:",
        tests=TESTS,
    ),
    Fault(
        name="regions: an edited text is not compared with what it should say",
        file="kolsky/base/toml.py",
        right="same = tomllib.loads(text) == wanted",
        wrong="same = tomllib.loads(text) is not None",
        tests=("tests/unit/shot/test_regions_by_hand.py::test_an_edit_that_says_something_else_is_refused",),
    ),
    Fault(
        name="regions: requests of other hosts are answered",
        file=SERVER,
        right='own = self.headers.get("Host") == self.server.host',
        wrong='own = self.headers.get("Host") is not None',
        tests=TESTS,
    ),
    Fault(
        name="regions: a file that changed meanwhile is overwritten",
        file="kolsky/pictures/regions.py",
        right="if self._read() != self._text:",
        wrong="if self._read() is None:",
        tests=TESTS,
    ),
)

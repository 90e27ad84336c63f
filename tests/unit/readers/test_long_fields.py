"""Very long fields take no time, although the time of a search grows with a power of their length."""

import signal
from collections.abc import Callable, Iterator

import pytest

from kolsky.base.toml import key_lines as toml_lines
from kolsky.base.units import UnitError, quantity, unit_factor
from kolsky.readers.header import _number, _Stated, key_lines, likely_unit, split_unit

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="needs an alarm of POSIX")

LONG = 300_000


@pytest.fixture(autouse=True)
def _in_time() -> Iterator[None]:
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("took more than five seconds"))
    signal.alarm(5)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("field", ["[" + " " * 3000, "a" * LONG, "a " * LONG, "a (" + "m" * LONG, "(" * LONG])
@pytest.mark.parametrize("search", [split_unit, likely_unit, toml_lines])
def test_a_long_field_has_no_unit(search: Callable[[str], object], field: str) -> None:
    search(field)


@pytest.mark.parametrize("text", ["m" * LONG, "m " * LONG, " " * LONG])
def test_a_long_unit_is_none(text: str) -> None:
    with pytest.raises(UnitError):
        unit_factor(text, "m")
    with pytest.raises(UnitError):
        quantity(f"1 {text}", "m")


def test_keys_of_tables_are_found_as_before() -> None:
    lines = toml_lines('[ specimen ]\nlength = "1 mm"  # [x]\n[ "a" . b ] # c\n d . e = 1\n')
    assert lines == {"specimen": 1, "specimen.length": 2, "a.b": 3, "a.b.d.e": 4}


def test_an_exponent_beyond_all_numbers_is_no_traceback() -> None:
    assert _number("1e999999999", ".") is not None
    assert _number("20 ns", ".") == _Stated(20.0, 1.0, "ns")
    assert _number("4.0E-10", ".") == _Stated(4e-10, pytest.approx(1e-11, rel=1e-15), "")  # type: ignore[arg-type]


def test_a_header_of_long_lines() -> None:
    class Comma:
        delimiter = ","

    words = ",".join(f"CH{k}" for k in range(200))
    assert key_lines(Comma(), [f"Trace Name,{words}"])["Trace Name"][-1] == "CH199"  # type: ignore[arg-type]
    assert key_lines(Comma(), [" " * LONG + "a", "a" + " " * LONG + "b"]) == {}  # type: ignore[arg-type]

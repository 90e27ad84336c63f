"""The evaluation of the corpus can fail, and damage is reproducible."""

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies

from dic.camera_files.source import CameraFileError
from dic.images.series import PictureError
from doe.ledger import LedgerError
from kolsky.base.errors import InputError, InputErrors
from tests.fuzz.cases import KINDS, Case, any_case, corpus, make
from tests.fuzz.hostile import traps
from tests.fuzz.judge import LARGEST, Verdict, of_content, of_refusal
from tests.fuzz.targets import all_targets
from tests.fuzz.worker import answered, answers

PATH = Path("folder") / "a.csv"
FAST = (
    "recorder plain", "recorder mat", "camera vic3d", "picture a1.png", "points of a design", "any TOML file",
)  # fmt: skip
"""Targets that are read in milliseconds."""


def _judged(content: Any, sound: Any, **more: bool) -> str:
    return of_content(content, sound, **{"cut": False, "told_length": False, "told_values": False, **more})


def test_a_refusal_needs_a_name_a_cure_and_one_line() -> None:
    assert of_refusal(InputError(PATH, "is odd", cure="mend it"), PATH)[0] is Verdict.REFUSED
    assert of_refusal(InputError(PATH, "is odd", cure="`kolsky new` writes one"), PATH)[0] is Verdict.REFUSED
    assert of_refusal(InputError(PATH, "is odd", allowed="> 0"), PATH)[0] is Verdict.REFUSED
    assert of_refusal(InputError(PATH, "is odd"), PATH)[0] is Verdict.UNHELPFUL
    assert of_refusal(InputError(PATH, "is not allowed (odd)"), PATH)[0] is Verdict.UNHELPFUL
    assert of_refusal(PictureError(PATH, "is odd", cure="mend it"), PATH)[0] is Verdict.REFUSED
    assert of_refusal(LedgerError(f"{PATH}: is\x1bodd; mend it"), PATH)[0] is Verdict.UNHELPFUL
    assert of_refusal(InputError("else", "is odd", cure="mend it"), PATH)[0] is Verdict.UNHELPFUL
    assert of_refusal(LedgerError(f"{PATH}: is\nodd; mend it"), PATH)[0] is Verdict.UNHELPFUL
    for refusal in (PictureError, CameraFileError):  # what a library says is quoted: its escapes are not
        assert str(refusal(PATH, "\x1b[31m\n", cure="x")) == f"{PATH}: \\x1b[31m\\n; x"
    two = InputErrors([InputError(PATH, "a", cure="b"), InputError(PATH, "c")])
    assert of_refusal(two, PATH)[0] is Verdict.UNHELPFUL


def test_what_is_silently_wrong() -> None:
    sound, other = {"a": np.arange(3.0)}, {"a": np.arange(2.0)}
    assert _judged(other, sound, cut=True, told_length=True)
    assert not _judged(other, sound, cut=True)
    assert not _judged(sound, sound, cut=True, told_length=True)
    assert _judged([1.0, 2.0], [1.0, 3.0], told_values=True)
    assert not _judged([1.0, None], [1.0, 3.0], told_values=True)

    class Record:
        value = np.array([1.0, np.inf])

    assert _judged({"CH1": Record()}, {})


def test_tracebacks_slowness_and_floods_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise KeyError("x")

    def refuse_after(seconds: float, size: int) -> None:
        held = np.ones(size)
        end = time.process_time() + seconds
        while time.process_time() < end:
            held[0] += 1.0
        raise InputError(PATH, "is odd", cure="mend it")

    assert answered("a", fail, PATH, lambda _: "").verdict is Verdict.TRACEBACK
    assert answered("a", lambda: 1, PATH, lambda _: "odd").verdict is Verdict.WRONG
    monkeypatch.setattr("tests.fuzz.worker.LONGEST", 0.05)
    assert answered("a", lambda: refuse_after(0.1, 1), PATH, lambda _: "").verdict is Verdict.SLOW
    monkeypatch.setattr("tests.fuzz.worker.LONGEST", 10.0)
    monkeypatch.setattr("tests.fuzz.worker.LARGEST", LARGEST / 50.0)
    if Path("/proc/self/clear_refs").exists():
        assert (
            answered("a", lambda: refuse_after(0.0, 10_000_000), PATH, lambda _: "").verdict is Verdict.LARGE
        )


def test_every_kind_of_damage_is_the_same_again_and_changes_something(tmp_path: Path) -> None:
    names = {"text": "data of a specimen", "toml": "settings of a specimen", "binary": "picture a1.bmp"}
    for form, name in names.items():
        target = all_targets()[name]
        sound = target.write(tmp_path / form if (tmp_path / form).mkdir() is None else tmp_path)
        for kind in KINDS[form]:
            made = [
                make(
                    Case(name, kind, seed), target, sound, tmp_path / f"{form}-{kind}-{seed}-{again}"
                ).read_bytes()
                for seed in (1, 2, 3)
                for again in (0, 1)
            ]
            assert made[::2] == made[1::2]
            assert any(data != sound.read_bytes() for data in made)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(case=strategies.deferred(lambda: any_case(*FAST)))
def test_cases_at_random(case: Case, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A few of the quick targets; `python -m tests.fuzz --seconds N` goes on for longer."""
    target = all_targets()[case.target]
    folder = tmp_path_factory.mktemp("sound")
    sound = target.write(folder)
    damaged = make(case, target, sound, tmp_path_factory.mktemp("case"))
    answer = answered(str(case), lambda: target.read(damaged), damaged, lambda _: "")
    assert answer.verdict.good, answer


FEWEST = 1500  # cases that the corpus must have
EVERY = 6  # of so many cases one is read here; `python -m tests.fuzz` reads all of them


@pytest.mark.slow
def test_nothing_is_wrong_in_silence_and_nothing_ends_in_a_traceback() -> None:
    cases = [*corpus(), *traps()]
    assert len(cases) >= FEWEST
    cases = cases[::EVERY]
    found = list(answers(cases, workers=2))
    assert Counter(answer.case for answer in found) == Counter(map(str, cases))
    wrong = [
        f"{answer.verdict.value}: {answer.case}: {answer.said}" for answer in found if not answer.verdict.good
    ]
    assert not wrong, "\n".join(wrong)

"""The fixed corpus of damaged files and traps: every one refused in one line, or rightly read."""

from collections import Counter

import pytest

from tests.fuzz.cases import corpus
from tests.fuzz.hostile import traps
from tests.fuzz.worker import answers

FEWEST = 1500
"""Cases that the corpus must have."""


@pytest.mark.slow  # three to four minutes on two cores
def test_nothing_is_wrong_in_silence_and_nothing_ends_in_a_traceback() -> None:
    cases = [*corpus(), *traps()]
    assert len(cases) >= FEWEST
    found = list(answers(cases, workers=2))
    assert Counter(answer.case for answer in found) == Counter(map(str, cases))
    wrong = [
        f"{answer.verdict.value}: {answer.case}: {answer.said}" for answer in found if not answer.verdict.good
    ]
    assert not wrong, "\n".join(wrong)

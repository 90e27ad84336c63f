"""`python -m tests.fuzz`: the fixed corpus; with `--seconds N` cases at random for so long; exit 1 if one is
answered wrongly. `--only WORD` runs the cases with this word in their name. `--workers N` sets the number of
processes."""

import argparse
import json
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.fuzz.cases import KINDS, Case, corpus
from tests.fuzz.hdf5_damage import OF_HDF5
from tests.fuzz.hostile import traps
from tests.fuzz.judge import Answer
from tests.fuzz.targets import all_targets
from tests.fuzz.worker import answers

BATCH = 400  # cases at random between two looks at the clock


def drawn(seconds: float, seed: int, only: list[str], workers: int) -> Iterator[Answer]:
    """Answers to cases at random until the time is over."""
    rng = random.Random(seed)
    targets = [target for target in all_targets().values() if any(word in target.name for word in only)]
    started = time.monotonic()
    while time.monotonic() - started < seconds:
        cases = []
        for _ in range(BATCH):
            target = rng.choice(targets)
            kinds = [*KINDS[target.form], *(OF_HDF5 if target.form == "hdf5" else ())]
            cases.append(Case(target.name, rng.choice(kinds), rng.randrange(2**32)))
        yield from answers(cases, workers=workers)


def main(words: list[str]) -> int:
    """Print what is answered wrongly and a count; 1 if anything is."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=0.0, help="time of a random part [s]; 0: the corpus")
    parser.add_argument("--seed", type=int, default=1, help="of the random part")
    parser.add_argument("--only", nargs="*", default=[""], metavar="WORD", help="cases whose name holds one")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--record", type=Path, help="write the counts there: benchmarks/results/fuzz.json")
    parser.add_argument("--all", action="store_true", help="print every answer")
    said = parser.parse_args(words)
    if said.seconds > 0.0:
        found = drawn(said.seconds, said.seed, said.only, said.workers)
    else:
        cases = [case for case in (*corpus(), *traps()) if any(word in str(case) for word in said.only)]
        found = answers(cases, workers=said.workers)
    groups: dict[str, Counter[str]] = {}
    counts: Counter[str] = Counter()
    started = time.monotonic()
    for answer in found:
        counts[answer.verdict.value] += 1
        groups.setdefault(answer.case.split()[0], Counter())[answer.verdict.value] += 1
        if said.all or not answer.verdict.good:
            print(
                f"{answer.verdict.value:12} {answer.seconds:5.2f} s {answer.case}: {answer.said}", flush=True
            )
    if said.record is not None:
        made = {"groups": {name: dict(sorted(groups[name].items())) for name in sorted(groups)}}
        said.record.write_text(json.dumps(made, indent=1) + "\n")
    wrong = sum(count for name, count in counts.items() if name not in ("refused", "accepted"))
    print(f"{sum(counts.values())} cases in {time.monotonic() - started:.0f} s: {dict(counts)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

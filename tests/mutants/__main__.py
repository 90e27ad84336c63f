"""`python -m tests.mutants [WORDS]`: plant the faults whose names hold all the words; exit 1 if one
survives. `--every 2` plants every second of them, which takes half the time."""

import os
import sys
from time import perf_counter

from tests.mutants import FAULTS
from tests.mutants.trial import Fate, trials


def main(words: list[str]) -> int:
    """Print a line a fault; 1 if one was not killed."""
    step = 1
    if "--every" in words:
        at = words.index("--every")
        step, words = int(words[at + 1]), [*words[:at], *words[at + 2 :]]
    chosen = [fault for fault in FAULTS if all(word in f"{fault.file} {fault.name}" for word in words)][
        ::step
    ]
    if not chosen:
        print(f"no fault has {' and '.join(words)!r} in its name or file; there are {len(FAULTS)}")
        return 2
    started, left = perf_counter(), []
    for number, (fault, fate) in enumerate(trials(chosen, processes=os.cpu_count() or 1), start=1):
        print(f"{number:3}/{len(chosen)} {fate:9} {fault.file}: {fault.name}", flush=True)
        if fate is not Fate.KILLED:
            left.append(fault)
    print(f"{len(chosen) - len(left)} of {len(chosen)} faults killed in {perf_counter() - started:.0f} s")
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

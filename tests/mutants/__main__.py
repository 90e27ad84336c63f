"""`python -m tests.mutants [WORDS]`: plant the faults whose file, function or name holds all the words;
exit 1 if one survives. `--every 2` plants every second fault and takes half the time."""

import os
import sys
from time import perf_counter

from tests.mutants import FAULTS, Fault
from tests.mutants.sources import sources
from tests.mutants.trial import Fate, trials


def main(words: list[str]) -> int:
    """Print a line a fault; 1 if one was not killed."""
    step = 1
    if "--every" in words:
        at = words.index("--every")
        step, words = int(words[at + 1]), [*words[:at], *words[at + 2 :]]
    titles = {fault: _title(fault) for fault in FAULTS}
    chosen = [fault for fault in FAULTS if all(word in titles[fault] for word in words)][::step]
    if not chosen:
        print(f"no fault has {' and '.join(words)!r} in its file, function or name; there are {len(FAULTS)}")
        return 2
    started, left = perf_counter(), []
    for number, (fault, fate) in enumerate(trials(chosen, processes=os.cpu_count() or 1), start=1):
        print(f"{number:3}/{len(chosen)} {fate:9} {titles[fault]}", flush=True)
        if fate is not Fate.KILLED:
            left.append(fault)
    print(f"{len(chosen) - len(left)} of {len(chosen)} faults killed in {perf_counter() - started:.0f} s")
    return 1 if left else 0


def _title(fault: Fault) -> str:
    return f"{sources().place(fault).module.file}: {fault.function}: {fault.name}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The command: `python -m tests.golden list`, `make STORE` and `compare STORE`, with `--only NAME ...`."""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from tests.golden.cases import CASES, Case
from tests.golden.running import Places, compare_case, imported, run_case

REPOSITORY = Path(__file__).resolve().parents[2]


def main() -> int:
    """Run the command and return its exit code: 1 where a result differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("what", choices=("list", "make", "compare"))
    parser.add_argument("store", nargs="?", type=Path, help="folder of the kept results")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these cases alone")
    parser.add_argument("--cheap", action="store_true", help="only cases of less than half a minute")
    parser.add_argument("--source", type=Path, default=REPOSITORY, help="repository that is run")
    parser.add_argument("--shared", type=Path, default=REPOSITORY.parent / "shared", help="its large data")
    parser.add_argument("--lines", type=int, default=12, help="of what differs in a case, so many lines")
    given = parser.parse_args()
    unknown = set(given.only) - {case.name for case in CASES}
    if unknown:
        parser.error(f"no case is called {', '.join(sorted(unknown))}")
    cases = [c for c in CASES if (not given.only or c.name in given.only) and (c.cheap or not given.cheap)]
    if given.what == "list":
        for case in cases:
            print(f"{case.name}{'' if case.cheap else ' (longer)'}", *case.commands, sep="\n    ")
        return 0
    if given.store is None:
        parser.error("name the folder of the kept results")
    places = Places(given.source.resolve(), given.shared.resolve())
    package = imported(places.source)
    print(f"kolsky is {package}", flush=True)
    if not package.is_relative_to(places.source):
        sys.exit(f"the commands would not import kolsky of {places.source}")
    run = make if given.what == "make" else compare
    return max([run(case, places, given.store, given.lines) for case in cases], default=0)


def make(case: Case, places: Places, store: Path, lines: int) -> int:
    """Keep the results of a case; 1 where one of its commands failed."""
    seconds = run_case(case, places, store / case.name)
    facts = json.loads((store / case.name / "case.json").read_text(encoding="utf-8"))
    print(f"{case.name}: {seconds:.1f} s", flush=True)
    failed = 0
    for i, one in enumerate(facts["commands"]):
        if one["code"]:
            failed = 1
            said = (store / case.name / f"stderr_{i}.txt").read_text(encoding="utf-8").strip().splitlines()
            print(f"  exit code {one['code']}: {one['line'][:150]}", *said[-min(lines, 4) :], sep="\n  ")
    return failed


def compare(case: Case, places: Places, store: Path, lines: int) -> int:
    """Run a case again and print what differs; 1 if something does."""
    if not (store / case.name / "case.json").exists():
        print(f"{case.name}: not in {store}")
        return 1
    with tempfile.TemporaryDirectory(prefix="golden_new_") as name:
        seconds = run_case(case, places, Path(name) / case.name)
        said = compare_case(store / case.name, Path(name) / case.name)
    print(f"{case.name}: {f'{len(said)} differences' if said else 'equal'} ({seconds:.1f} s)", flush=True)
    for line in said[:lines]:
        print(f"  {line}")
    if len(said) > lines:
        print(f"  and {len(said) - lines} more")
    return int(bool(said))


if __name__ == "__main__":
    sys.exit(main())

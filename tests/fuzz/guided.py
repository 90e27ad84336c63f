"""`python -m tests.fuzz.guided NAME [options of libFuzzer]`: damage of one target's file guided by coverage.

It needs Atheris (`pip install atheris`, Linux, CPython up to 3.11 or as stated on its page). NAME is a target
as `python -m tests.fuzz --all` prints it, e.g. "recorder mat"; `-max_total_time=600` ends it after ten
minutes. Inputs that cause another error than a rejection are stored by libFuzzer as `crash-*`.
"""

import sys
import tempfile
import warnings
from pathlib import Path

READING = ("kolsky.readers", "kolsky.shot", "kolsky.base", "dic.images", "dic.camera_files", "doe.ledger")
"""What is watched: what reads files. To watch the solvers too would take minutes before the first input."""


def main(words: list[str]) -> int:
    """Feed one target; 2 if it cannot be done."""
    try:
        import atheris
    except ImportError:
        print("needs Atheris: pip install atheris")
        return 2
    with atheris.instrument_imports(include=list(READING)):
        from tests.fuzz.judge import REFUSALS, Verdict, of_refusal  # it loads readers: watched too
        from tests.fuzz.targets import all_targets

        targets = all_targets()
    if not words or words[0] not in targets:
        print("name one of: " + ", ".join(targets))
        return 2
    target = targets[words[0]]
    base = Path(tempfile.mkdtemp(prefix="guided-"))
    path = target.write(base)
    seeds = base.parent / f"{base.name}-seeds"
    seeds.mkdir()
    (seeds / "sound").write_bytes(path.read_bytes())

    def one(data: bytes) -> None:
        path.write_bytes(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                target.read(path)
            except REFUSALS as error:
                verdict, said = of_refusal(error, path)
                if verdict is not Verdict.REFUSED:
                    raise AssertionError(said) from error

    atheris.Setup([sys.argv[0], "-len_control=0", *words[1:], str(seeds)], one)  # whole files at once
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Compile the time loops ahead of time, for a CUDA machine without a compiler cache.

    python -m explicit.aot --arch 90 --out modules            # on any machine; no GPU needed
    KOLSKY_AOT=modules kolsky identify runs/open-01 --device cuda     # on the GPU machine
    python -m explicit.aot --out modules --relaxation none prony --contacts bonded/bonded --precision fp64

The last line is for shots of bonded specimens with `--relaxation prony`, which are held against the same
without it.
`explicit.modules.ahead_of_time` does the same from Python.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from explicit.elements import ELEMENTS
from explicit.materials import LAWS, MarlowLaw
from explicit.modules import USUAL_CONTACTS, choices, compile_each
from explicit.precision import PRECISIONS
from explicit.relaxation import RELAXATIONS
from explicit.relaxation.base import Relaxation


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m explicit.aot", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the modules")
    parser.add_argument("--arch", type=int, nargs="+", default=[90], help="compute capabilities, ten times")
    parser.add_argument(
        "--contacts",
        nargs="+",
        metavar="FACES/SIDE",
        default=["/".join(pair) for pair in USUAL_CONTACTS],
        help="contact laws of faces and side, such as bonded/coulomb; default one law on\n"
        "both, and bonded faces with any law on the side",
    )
    parser.add_argument("--law", choices=["marlow", *LAWS], default="marlow", help="material law")
    parser.add_argument(
        "--relaxation",
        nargs="+",
        metavar="KIND[:BRANCHES]",
        default=["none"],
        help=f"what relaxes: none, {', '.join(RELAXATIONS)}, with the branches of a batch's longest\n"
        "series, 1 if left out; default none",
    )
    parser.add_argument("--precision", nargs="+", default=list(PRECISIONS))
    parser.add_argument("--element", nargs="+", default=list(ELEMENTS))
    parser.add_argument("--ptx", action="store_true", help="PTX for these and later architectures")
    options = parser.parse_args(arguments)
    try:
        pairs = [_pair(text) for text in options.contacts]
        wanted = choices(pairs, options.precision, options.element)
        law = MarlowLaw if options.law == "marlow" else LAWS[options.law]
        kinds = [_relaxation(text) for text in options.relaxation]
        started = time.perf_counter()
        for kind in kinds:
            for path in compile_each(
                options.out, options.arch, wanted, law=law, relaxation=kind, ptx=options.ptx
            ):
                print(f"{time.perf_counter() - started:6.1f} s  {path}", flush=True)
    except ValueError as error:
        parser.error(str(error))


def _pair(text: str) -> tuple[str, str]:
    faces, slash, side = text.partition("/")
    if not slash:
        raise ValueError(f"contacts must be written faces/side, such as bonded/coulomb, got {text!r}")
    return faces, side


def _relaxation(text: str) -> Relaxation | None:
    kind, colon, branches = text.partition(":")
    if text == "none":
        return None
    if kind not in RELAXATIONS:
        raise ValueError(f"what relaxes must be none or one of {sorted(RELAXATIONS)}, got {kind!r}")
    if colon and not (branches.isdecimal() and int(branches) > 0):
        raise ValueError(f"branches must be a number above 0, such as prony:2, got {text!r}")
    return RELAXATIONS[kind].kind(int(branches) if colon else 1)


if __name__ == "__main__":
    main()

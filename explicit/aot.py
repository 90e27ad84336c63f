"""Time loops compiled ahead of time for a CUDA machine without a compiler cache.

    python -m explicit.aot --arch 90 --out modules            # on any machine; no GPU needed
    KOLSKY_AOT=modules kolsky identify runs/open-01 --device cuda     # on the GPU machine
    python -m explicit.aot --out modules --relaxation none prony --contacts bonded/bonded --precision fp64

The last line is for shots of bonded specimens with `--relaxation prony`. Such shots are also run without
relaxation. `ahead_of_time` is the equivalent Python function. The folder contains machine code (cubin) of one
architecture, or PTX. The driver of this or any later architecture compiles PTX. The name of a file contains
the hash of the kernel's source and options. The name of its folder contains the version of Warp. A file of
different sources is therefore never loaded.
"""

import argparse
import os
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import warp as wp

from explicit.contact import CONTACT_LAWS, contact_law
from explicit.device import select_device
from explicit.elements import ELEMENTS, element
from explicit.layout.lanes import BLOCK, CLUSTER_ARCH, CLUSTERS, SMALL_BLOCK
from explicit.materials import LAWS, MarlowLaw
from explicit.precision import PRECISIONS, precision
from explicit.relaxation import RELAXATIONS
from explicit.relaxation.base import Relaxation
from explicit.time_loop.kernel import time_loop_kernel

FOLDER_VARIABLE = "KOLSKY_AOT"
"""Environment variable that names the folder of modules if `explicit.run` gets none."""
USUAL_CONTACTS = (
    *((law, law) for law in CONTACT_LAWS),
    *(("bonded", law) for law in CONTACT_LAWS if law != "bonded"),
)
"""Contact laws of faces and side: one law on both, and bonded faces with any law on the side."""


def ahead_of_time(
    folder: Path | str,
    *,
    architectures: Sequence[int] = (90,),
    contacts: Iterable[tuple[str, str]] = USUAL_CONTACTS,
    precisions: Iterable[str] = tuple(PRECISIONS),
    elements: Iterable[str] = tuple(ELEMENTS),
    law: type = MarlowLaw,
    relaxation: Relaxation | None = None,
    ptx: bool = False,
) -> list[Path]:
    """Compile time loops for CUDA devices, with or without a GPU in this machine.

    Parameters
    ----------
    folder : Path or str
        Target folder; created if missing. Existing modules are not compiled again.
    architectures : sequence of int
        Compute capabilities times ten: 80 is an A100, 90 an H100 or H200.
    contacts : iterable of (str, str)
        Contact laws of the faces and of the side surface; default `USUAL_CONTACTS`.
    precisions, elements : iterable of str
        Names of `explicit.precision.PRECISIONS` and of `explicit.elements.ELEMENTS`; default all.
    law : type
        Class of the material law.
    relaxation : Relaxation, optional
        Kind of relaxation, such as ``PronySeries.kind(n_branches)``: `explicit.Model.relaxation_kind`.
    ptx : bool
        Write PTX instead of machine code. PTX is also valid for later architectures.

    Returns
    -------
    list of Path
        The compiled files, three for each combination and architecture: state on the chip for small batches,
        state on the chip for large batches, and state in global memory. If blocks can share a simulation,
        there are four more: each number of blocks, with and without the state on their chips.

    Raises
    ------
    ValueError
        If an architecture is not supported by Warp's compiler, or a name is not known.
    """
    variants = choices(contacts, precisions, elements)
    return list(compile_each(folder, architectures, variants, law=law, relaxation=relaxation, ptx=ptx))


Choice = tuple[str, str, str, str]
"""Faces, side, precision and element of a time loop, by name."""


def choices(
    contacts: Iterable[tuple[str, str]], precisions: Iterable[str], elements: Iterable[str]
) -> list[Choice]:
    """Every combination, each name checked.

    Raises ValueError if a name is unknown; the message lists the valid names.
    """
    combinations = [(*pair, number, shape) for pair, number, shape in product(contacts, precisions, elements)]
    for faces, side, number, shape in combinations:
        contact_law(faces), contact_law(side), precision(number), element(shape)
    return combinations


def compile_each(
    folder: Path | str,
    architectures: Sequence[int],
    combinations: Iterable[Choice],
    *,
    law: type,
    relaxation: Relaxation | None = None,
    ptx: bool,
) -> Iterator[Path]:
    """Compile sequentially; see `ahead_of_time`."""
    select_device("cpu")
    supported = wp.get_cuda_supported_archs()
    for arch in architectures:
        if arch not in supported:
            raise ValueError(f"architecture must be one of {supported}, got {arch}")
    place = _folder_of(folder)
    # A mesh that fits has its state in shared memory; a larger one has it in global memory.
    variants = [(True, BLOCK, 1), (True, SMALL_BLOCK, 1), (False, BLOCK, 1)]
    variants += [(on_chip, BLOCK, cluster) for on_chip, cluster in product((True, False), CLUSTERS)]
    for (faces, side, number, shape), (on_chip, block, cluster) in product(combinations, variants):
        able = [arch for arch in architectures if cluster == 1 or arch >= CLUSTER_ARCH]
        numbers, shared = precision(number), {"relaxation": relaxation, "cluster": cluster}
        if not able:
            continue
        module = _module(time_loop_kernel(law, faces, side, numbers, shape, on_chip, block, **shared))
        wp.compile_aot_module(module, arch=able, module_dir=place, use_ptx=ptx)
        for source in place.glob(f"wp_{module.name}_*.cu"):
            source.unlink()  # a load of a module does not need it
        for arch in able:
            yield from place.glob(f"wp_{module.name}_*.sm{arch}.{'ptx' if ptx else 'cubin'}")


def load_module(kernel: Any, device: Any, folder: Path | str | None) -> bool:
    """Load the time loop from a folder of modules on a CUDA device.

    ``kernel``: the time loop. ``device``: a Warp device; nothing is done for a CPU. ``folder``: written by
    `ahead_of_time`; default is the environment variable ``KOLSKY_AOT``, or none. Returns: whether a module
    was found. If a given folder has no module for this time loop and device, there is one `RuntimeWarning`,
    and the launch compiles it. Raises ValueError if the given folder does not exist.
    """
    folder = folder or os.environ.get(FOLDER_VARIABLE) or None
    if folder is None or not device.is_cuda:
        return False
    if not Path(folder).is_dir():
        raise ValueError(
            f"the folder of modules must exist, got {str(folder)!r}; write it with `python -m explicit.aot`, "
            f"or name none (argument `modules`, environment variable {FOLDER_VARIABLE})"
        )
    module, place = _module(kernel), _folder_of(folder)
    loaded = _LOADED.setdefault(module, set())
    if (device.alias, place) in loaded:
        return True
    for arch, ptx in candidates(place, device.arch):
        try:
            wp.load_aot_module(module, device=device, arch=arch, module_dir=place, use_ptx=ptx)
        except FileNotFoundError:
            continue
        loaded.add((device.alias, place))
        return True
    _missing(str(place), module.name, device.arch)
    return False


_LOADED: WeakKeyDictionary[Any, set[tuple[str, Path]]] = WeakKeyDictionary()
"""Devices and folders for which a module has been loaded."""


def candidates(place: Path, arch: int) -> list[tuple[int, bool]]:
    """(architecture, whether PTX) of the code that a device of architecture `arch` can run, the best first.

    Machine code runs only on its architecture. PTX runs on the architecture of its name and on later ones.
    """
    written = {int(path.name.split(".")[-2][2:]) for path in place.glob("*.sm[0-9]*.ptx")}
    return [(arch, False)] + [(older, True) for older in sorted(written, reverse=True) if older <= arch]


def _folder_of(folder: Path | str) -> Path:
    return Path(folder) / f"warp-{wp.__version__}"


def _module(kernel: Any) -> Any:
    module = kernel.kernel.module
    module.options["block_dim"] = kernel.block  # part of the hash: the values of the launch
    return module


@cache
def _missing(place: str, name: str, arch: int) -> None:
    warnings.warn(
        f"{place} holds no module {name} for architecture {arch}: other sources, or a choice of laws, "
        f"precision and element that was not compiled; it is compiled now. "
        f"`python -m explicit.aot --arch {arch} --out ...` writes it",
        RuntimeWarning,
        stacklevel=4,
    )


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
        help=f"relaxation: none, {', '.join(RELAXATIONS)}, with the branches of a batch's longest\n"
        "series, 1 if left out; default none",
    )
    parser.add_argument("--precision", nargs="+", default=list(PRECISIONS))
    parser.add_argument("--element", nargs="+", default=list(ELEMENTS))
    parser.add_argument("--ptx", action="store_true", help="PTX for these and later architectures")
    options = parser.parse_args(arguments)
    try:
        pairs = [_pair(text) for text in options.contacts]
        combinations = choices(pairs, options.precision, options.element)
        law = MarlowLaw if options.law == "marlow" else LAWS[options.law]
        kinds = [_relaxation(text) for text in options.relaxation]
        started = time.perf_counter()
        for kind in kinds:
            for path in compile_each(
                options.out, options.arch, combinations, law=law, relaxation=kind, ptx=options.ptx
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
        raise ValueError(f"the relaxation must be none or one of {sorted(RELAXATIONS)}, got {kind!r}")
    if colon and not (branches.isdecimal() and int(branches) > 0):
        raise ValueError(f"branches must be a number above 0, such as prony:2, got {text!r}")
    return RELAXATIONS[kind].kind(int(branches) if colon else 1)


if __name__ == "__main__":
    main()

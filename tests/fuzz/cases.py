"""Cases: files and their damage. The fixed corpus, and strategies for random cases."""

import random
import shutil
import zlib
from dataclasses import dataclass
from pathlib import Path

from hypothesis import strategies

from tests.fuzz.damage import ANY, OF_TEXT, OF_TOML, Damage
from tests.fuzz.hdf5_damage import OF_HDF5, damage_hdf5
from tests.fuzz.targets import Target, all_targets

KINDS: dict[str, dict[str, Damage]] = {"text": OF_TEXT, "toml": OF_TOML, "binary": ANY, "hdf5": ANY}
"""Damage of the bytes, by form."""
SEEDS = {"text": 3, "toml": 4, "binary": 3, "hdf5": 2}  # cases of each kind of damage in the corpus, by form
INSIDE = 6  # cases of each kind of damage inside an HDF5 file in the corpus
COSTLY = ("lecroy_trc", "tektronix_isf", "tektronix_wfm", "yokogawa_wfm", "rohde_schwarz", "excel_97", "mat")
"""Recorders whose library takes half a second for a file: one case of each kind."""


@dataclass(frozen=True)
class Case:
    """One damaged file."""

    target: str
    kind: str
    seed: int

    def __str__(self) -> str:
        return f"{self.target} | {self.kind} | {self.seed}"


def make(case: Case, target: Target, sound: Path, folder: Path) -> Path:
    """The damaged file in an empty folder, with what belongs to it.

    ``folder``: where the damaged one goes.
    """
    shutil.copytree(sound.parent, folder, dirs_exist_ok=True)
    path = folder / sound.name
    # The seed is of the whole case: the same damage elsewhere has other places.
    rng = random.Random(zlib.crc32(str(case).encode()))
    if case.kind in OF_HDF5:
        damage_hdf5(path, case.kind, rng)
    else:
        path.write_bytes(KINDS[target.form][case.kind](path.read_bytes(), rng))
    return path


def corpus() -> list[Case]:
    """The fixed corpus: every target with every damage of its form."""
    cases = []
    for name, target in all_targets().items():
        seeds = 1 if name.removeprefix("recorder ") in COSTLY else SEEDS[target.form]
        cases += [Case(name, kind, seed) for kind in KINDS[target.form] for seed in range(seeds)]
        if target.form == "hdf5":
            cases += [Case(name, kind, seed) for kind in OF_HDF5 for seed in range(INSIDE)]
    return cases


def any_case(*names: str) -> strategies.SearchStrategy[Case]:
    """Cases at random over some targets and every damage of their forms."""
    targets = all_targets()

    def of(target: Target) -> strategies.SearchStrategy[Case]:
        kinds = [*KINDS[target.form], *(OF_HDF5 if target.form == "hdf5" else ())]
        seeds = strategies.integers(0, 2**32 - 1)
        return strategies.builds(Case, strategies.just(target.name), strategies.sampled_from(kinds), seeds)

    return strategies.one_of([of(targets[name]) for name in names])

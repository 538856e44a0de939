"""The third tier's two halves: recordings, what a diagnosis is told of them, labels, and seals.

A half's folder holds 001/recording.csv and so on (and second.csv for some), cases.json (what is
told: files, the model that is believed or none, the noise where it is specified) and labels.sha256.
The labels of the sealed half are written elsewhere.  Its seed is not in the code: only the seed's
SHA-256 is, until it has been answered.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from ..exam import plain, write_labels, write_seal
from .case import build, write
from .design import EACH, Spec, design

DEVELOPMENT = 56001
SEED_HASH = Path(__file__).parent / "marks" / "sealed" / "seed.sha256"
DIGITS = 4  # of the labels' numbers, on which every machine agrees
TOLD = ("case", "files", "believed", "samples")


def seed_of(half: str, seed: int | None) -> int:
    """The half's seed; that of the sealed half must be given, and have the hash that is kept."""
    if half == "development":
        return DEVELOPMENT if seed is None else seed
    if seed is None:
        raise SystemExit("the sealed half needs its seed: --seed NUMBER")
    if hashlib.sha256(str(seed).encode()).hexdigest() != SEED_HASH.read_text().split()[0]:
        raise SystemExit(f"--seed {seed} has not the hash in {SEED_HASH.name}")
    return seed


def told_of(label: dict) -> dict:
    """What a diagnosis is told of a case."""
    noise = label["noise"]
    given = {"noise_um": noise["sensor_um"] if noise["given"] else None}
    return {key: label[key] for key in TOLD} | given


def make(spec: Spec, folder: Path) -> dict:
    """Build a case, write its recordings into the folder, and give its label."""
    recordings, label = build(spec)
    write(folder, recordings, label)
    return plain(label, DIGITS)


def labels_of(specs: Iterable[Spec], folder: Path, jobs: int) -> list[dict]:
    """Labels of the cases, whose recordings are written."""
    work = partial(make, folder=folder)
    if jobs == 1:
        return [work(spec) for spec in specs]
    with get_context("spawn").Pool(jobs) as pool:
        return pool.map(work, specs, chunksize=1)


def describe(labels: Sequence[dict]) -> str:
    """Counts: cases by number of effects, effects that the drives can show."""
    many = Counter(len(x["effects"]) for x in labels)
    effects = [e for x in labels for e in x["effects"]]
    shown = sum(e["detectability"] >= 5 for e in effects)
    any_law = sum(e["detectability_any"] >= 5 for e in effects)
    return (
        f"effects in a case {dict(sorted(many.items()))}; effects {len(effects)}, detectable "
        f"{shown}, whatever the memory {any_law}; noise given "
        f"{sum(x['noise']['given'] for x in labels)}; without a model "
        f"{sum(x['believed'] is None for x in labels)}"
    )


def build_half(half: str, out: Path, labels_in: Path, seed: int | None, part: slice,
               jobs: int) -> None:  # fmt: skip
    """Write a half, or a part of it."""
    if half not in EACH:
        raise SystemExit(f"--half is one of {', '.join(EACH)}, not {half}")
    start = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    labels_in.mkdir(parents=True, exist_ok=True)
    labels = labels_of(design(half, seed_of(half, seed))[part], out, jobs)
    write_labels(labels_in, labels)
    write_seal(out, labels)
    (out / "cases.json").write_text(json.dumps([told_of(x) for x in labels], indent=1) + "\n")
    print(f"{len(labels)} cases in {time.perf_counter() - start:.0f} s; {describe(labels)}")

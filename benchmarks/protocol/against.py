"""The optimised drive beside the recipe that it starts from and beside the next experiment of old.

python -m benchmarks.protocol.against [--to benchmarks/protocol]

Of each limits and duration the least detectability over the effects that a drive is designed for by
default, of their typical sizes at a noise of .1 % of the stroke, over what is needed to name them.
The next experiment of old, of what was unexplained, was a rest and sines in four amplitudes.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import numpy as np

import fracjax as fj
from fracjax._path import detectabilities
from fracjax._protocol import ASKED
from fracjax._protocol._design import TOP, Task, designed
from fracjax._protocol._limits import Limits, limits_of
from fracjax._protocol._recipe import Recipe
from fracjax._protocol._signals import ideal_signal

from .stages import AMPLIFIERS

DURATIONS, RATE, NOISE = (20.0, 60.0, 120.0), 1e4, 1e-3
EVALUATIONS = 200
HEADER = ("amplifier", "duration_s", "drive", "least", "worst", "times_optimised", "design_cpu_s")
ROOT = Path(__file__).parent


def sines(limits: Limits, duration: float, step: float) -> np.ndarray:
    """A rest at the start, then sines in four amplitudes at the middle of the tones of old: the
    geometric mean of two periods in all, and of the fastest that the slew or 16 samples allow."""
    count = round(duration / step)
    lead = count // 20
    t = np.arange(count - lead) * step
    fastest = min(1 / (16 * step), limits.slew / (np.pi * limits.span))
    frequency = np.sqrt(4 / duration * max(0.5 * fastest, 4 / duration))
    rising = np.minimum(1.0, 0.25 * (1 + np.floor(4 * t / t[-1])))
    waves = limits.centre - limits.reach * np.cos(2 * np.pi * frequency * t) * rising
    return np.concatenate([np.full(lead, limits.start), waves])


def rows_of(amplifier: str, duration: float) -> list[tuple]:
    """The rows of one amplifier and duration."""
    text, capacitance, _ = AMPLIFIERS[amplifier]
    limits, _ = limits_of(text, capacitance=capacitance)
    task = Task(limits, duration, 1 / RATE, TOP * RATE, 1 / limits.span, NOISE, ASKED)
    coarse = task.coarse()
    began = time.process_time()
    best = designed(task, EVALUATIONS, lambda text: None)
    seconds = time.process_time() - began
    old = sines(coarse.limits, duration, coarse.step)
    seen = {
        "optimised": coarse.seen(best),
        "recipe": coarse.seen(Recipe()),
        "sines in four amplitudes": detectabilities(
            [ideal_signal(old, coarse.step, coarse.slope, coarse.noise)], ASKED
        ),
    }
    least = min(seen["optimised"].values())
    return [
        (
            amplifier, f"{duration:g}", drive, f"{min(own.values()):.3g}",
            min(own, key=own.__getitem__), f"{least / min(own.values()):.3g}",
            f"{seconds:.1f}" if drive == "optimised" else "",
        )
        for drive, own in seen.items()
    ]  # fmt: skip


def main() -> None:
    """Write the table, and how long a whole call takes for two minutes at 10 kHz."""
    p = argparse.ArgumentParser(description="Drives beside each other.")
    p.add_argument("--to", type=Path, default=ROOT)
    a = p.parse_args()
    a.to.mkdir(parents=True, exist_ok=True)
    with (a.to / "against.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEADER)
        for amplifier in AMPLIFIERS:
            for duration in DURATIONS:
                table.writerows(rows_of(amplifier, duration))
    began, cpu = time.perf_counter(), time.process_time()
    text, capacitance, resolution = AMPLIFIERS["stage controller, 2 A"]
    fj.protocol(text, RATE, duration=120, capacitance=capacitance, resolution=resolution)
    with (a.to / "against_time.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("call", "wall_s", "cpu_s"))
        seconds = f"{time.perf_counter() - began:.1f}", f"{time.process_time() - cpu:.1f}"
        table.writerow(("two minutes at 10 kHz, whole", *seconds))


if __name__ == "__main__":
    main()

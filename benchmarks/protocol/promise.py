"""What designed drives promise, and what is named on them.

python -m benchmarks.protocol.promise [--cases 0:60] [--to benchmarks/protocol]

Sixty actuators, each with one effect at shares of the promised smallest size, peak to peak, and
without any.  Named is what the posterior under path curves holds for likelier than .95; an effect
of its family counts for it.  A law that degrades itself may be named so.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fracjax._path import SURE, Signal, family_of, view_of

from ..concealed.anylaw.effects import TRIED
from ..concealed.drives import Array
from ..concealed.truth import name_of
from .stages import Bench, bench

SHARES = (0.5, 0.71, 1.0, 1.41, 2.0)
PERIOD = 0.1
"""The amplitude of a mode: a period of five samples and a five-hundredth of the recording."""
WEAR = {"degradation", "gain_drift"}
HEADER = ("case", "law", "memory", "amplifier", "noise_percent", "key", "promised_percent", "share",
          "size_percent", "probability", "named", "wrong", "seconds")  # fmt: skip
ROOT = Path(__file__).parent


def signal_of(case: Bench, response: Array, rng: np.random.Generator) -> Signal:
    """The recording of a response [um]."""
    drive = case.designed.drive
    return Signal(
        drive=drive.values,
        response=response + case.noise * rng.standard_normal(response.size),
        step=drive.step,
        periodic=False,
        taps=np.array([1 / case.noise]),
        weights=np.ones(response.size),
        drive_error=np.zeros(response.size),
    )


def changed(case: Bench, key: str, shape: dict, size: float) -> Array | None:
    """The response [um] with an effect that changes it by `size` [um], peak to peak; None where no
    amplitude does.  Of a mode, which at the rate of the samples is large, so much of its change:
    one that takes a small part in the motion."""
    effect, scene = TRIED[key], case.stage.scene
    plain = case.stage.recorded([])
    if key == "resonance":
        change = case.stage.recorded([(effect, effect.parameters(PERIOD, shape, scene))]) - plain
        return plain + size / np.ptp(change) * change

    def at(logarithm: float) -> Array:
        pair = effect, effect.parameters(float(np.exp(logarithm)), shape, scene)
        return case.stage.recorded([pair])

    low, high = np.log(1e-7), np.log(effect.cap)
    if not np.ptp(at(low) - plain) < size < np.ptp(at(high) - plain):
        return None
    for _ in range(18):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.ptp(at(middle) - plain) < size else (low, middle)
        if high - low < 0.02:
            break
    return at(high)


def answered(case: Bench, response: Array, seed: Sequence[int]) -> tuple[dict[str, float], float]:
    """The probability of each effect on a recording, and the seconds that it took."""
    began = time.process_time()
    posterior = view_of([signal_of(case, response, np.random.default_rng(seed))]).posterior
    names = {name for hypothesis in posterior.hypotheses for name in hypothesis.names}
    return {n: posterior.probability_of(n) for n in names}, time.process_time() - began


def rows_of(number: int) -> Iterator[tuple]:
    """The rows of one actuator."""
    case, rng = bench(number), np.random.default_rng([59, number])
    keys = [k for k in TRIED if k not in ("second_mode", "slew_rate_limit")]
    key = keys[number % len(keys)]
    name, shape = name_of(key), TRIED[key].shape(rng)
    promised = {v.effect: v.size for v in case.designed.shows}.get(name)
    stroke = case.stage.scene.stroke
    own = WEAR if case.memory == "degrading" else set()
    for share in (0.0, *SHARES):
        if share and promised is None:
            break
        size = share * (promised or 0.0) / 100 * stroke
        response = changed(case, key, shape, size) if share else case.stage.recorded([])
        if response is None:
            continue
        found, seconds = answered(case, response, [60, number, int(100 * share)])
        alike = {name, *family_of(name)} if share else set()
        # Two names of a family share its probability.
        probability = min(sum(found.get(n, 0.0) for n in alike), 1.0)
        wrong = [n for n, p in found.items() if p > SURE and n not in alike | own]
        yield (
            number, case.law, case.memory, case.amplifier, f"{100 * case.noise / stroke:.3g}",
            key if share else "", f"{promised or 0:.3g}", share, f"{100 * size / stroke:.3g}",
            f"{probability:.3f}", int(probability > SURE), " ".join(wrong), f"{seconds:.1f}",
        )  # fmt: skip


def summary(rows: Sequence[dict[str, str]]) -> list[tuple[str, str, str]]:
    """The checks: what, the figure, of how many."""

    def share(what: str, chosen: Sequence, good) -> tuple[str, str, str]:
        count = sum(map(good, chosen))
        return what, f"{100 * count / max(len(chosen), 1):.1f}", f"{count} of {len(chosen)}"

    def named(row: dict[str, str]) -> bool:
        return row["named"] == "1"

    at = {s: [r for r in rows if float(r["share"]) == s] for s in (0.0, *SHARES)}
    out = [share(f"named at {s} times the promised size [%]", at[s], named) for s in SHARES]
    out.append(share("names what is not there [%]", list(rows), lambda r: bool(r["wrong"])))
    for memory in ("returning", "fading", "degrading"):
        out.append(
            share(
                f"names what is not there, memory {memory} [%]",
                [r for r in rows if r["memory"] == memory],
                lambda r: bool(r["wrong"]),
            )
        )
    ratios = [r for r in map(measured, _cases(rows)) if r is not None]
    out.append(
        share("measured size within a factor 1.5 of the promised [%]", ratios,
              lambda r: 1 / 1.5 <= r <= 1.5)
    )  # fmt: skip
    middle = f"{np.median(ratios):.2f}" if ratios else "–"
    out.append(("measured over promised size, median", middle, str(len(ratios))))
    return out


def _cases(rows: Sequence[dict[str, str]]) -> list[list[dict[str, str]]]:
    """The rows with an effect of each actuator, by size."""
    numbers = dict.fromkeys(r["case"] for r in rows)
    own = [[r for r in rows if r["case"] == n and float(r["share"]) > 0] for n in numbers]
    return [sorted(each, key=lambda r: float(r["share"])) for each in own if each]


def measured(rows: Sequence[dict[str, str]]) -> float | None:
    """The measured size over the promised: between the largest that is not named and the next; half
    a step beyond the tried where all are named, or none; None where not all were tried."""
    if len(rows) < len(SHARES):
        return None
    unnamed = [k for k, r in enumerate(rows) if r["named"] == "0"]
    step = SHARES[1] / SHARES[0]
    if not unnamed:
        return SHARES[0] / step**0.5
    return SHARES[unnamed[-1]] * step**0.5


def main() -> None:
    """Run the cases and write both tables."""
    p = argparse.ArgumentParser(description="Promised sizes, and what is named.")
    p.add_argument("--cases", default="0:60")
    p.add_argument("--to", type=Path, default=ROOT)
    a = p.parse_args()
    first, last = map(int, a.cases.split(":"))
    a.to.mkdir(parents=True, exist_ok=True)
    with (a.to / "promise.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEADER)
        for number in range(first, last):
            for row in rows_of(number):
                table.writerow(row)
            file.flush()
    with (a.to / "promise.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (a.to / "promise_summary.csv").open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows([("measure", "value", "count"), *summary(rows)])
    for line in summary(rows):
        print(*line)


if __name__ == "__main__":
    main()

"""A demonstration: FOH actuator with one concealed effect, and a held-out recording of it.

Run: python -m benchmarks.concealed.demo --effect minor_loop_memory --out DIR

`training.csv` (3,900 samples at 150 Hz, 26 s) repeats a 13 s drive exactly twice: rest, bursts
from 0.5 to 12 Hz, a staircase both ways with holds of 0.3 to 3 s, rest. `heldout.csv` is the same
actuator on another drive. `label.json` holds the truth.  FOH absorbs the memory of turning points
so well that R² is 0.99999; what it leaves is three times the noise, which is 0.02 % of the range.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path as File

import numpy as np

from .cases import Case, fine_grid, make_case, rms, write_csv
from .drives import Drive, burst, compose, rest, stairs
from .truth import BASES, EFFECTS, OVER, noise

RATE = 150.0


def training_drive() -> Drive:
    """Rest, bursts at 0.5, 2, 5 and 12 Hz, staircase both ways, rest; 13 s, repeated twice."""
    tones = [burst(f, c, a, 50) for f, c, a in ((0.5, 1, 45), (2, 2, 35), (5, 4, 25), (12, 8, 15))]
    levels, holds = [50, 80, 95, 20, 5, 50], [1.0, 1.5, 0.3, 3.0, 1.0]
    pieces = [rest(0.5, 50), *tones, *stairs(levels, holds, 0.1)]
    return compose("demo", [*pieces, rest(13 - sum(d for d, _ in pieces), 50)], 2, RATE)


def heldout_drive() -> Drive:
    """Bursts at other frequencies, levels and order than the training drive; about 20 s."""
    pieces = [
        rest(1.0, 50),
        *stairs([50, 10, 70], [4.0, 2.0], 0.1),
        burst(1.0, 3, 25, 70),
        burst(8.0, 6, 12, 70),
        *stairs([70, 90, 30], [1.0, 5.0], 0.1),
        burst(3.0, 5, 20, 30),
        rest(1.5, 30),
    ]
    return compose("demo_heldout", pieces, 1, RATE)


def demo(
    effect: str = "minor_loop_memory", level: float = 3.0, fraction: float = 2e-4, seed: int = 0
) -> tuple[Case, np.ndarray]:
    """The training case, and the held-out recording as columns s, V, um."""
    case = make_case("foh", effect, training_drive(), level, "white", seed, fraction)
    drive, label = heldout_drive(), case.label
    t, law = fine_grid(drive), label["base_parameters"]
    signal = drive.between("continuous")
    y = EFFECTS[effect].simulate(signal, t, BASES["foh"], law, label["parameters"])[::OVER]
    y = y + noise("white", len(y), label["noise_sd_um"], np.random.default_rng([seed, 13]))
    return case, np.column_stack([drive.times, drive(drive.times), y])


def main() -> None:
    """Command line: write training.csv, heldout.csv and label.json."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--effect", default="minor_loop_memory", choices=EFFECTS)
    p.add_argument("--level", type=float, default=3.0)
    p.add_argument("--noise-fraction", type=float, default=2e-4)
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--out", type=File, required=True)
    a = p.parse_args()
    case, held = demo(a.effect, a.level, a.noise_fraction, a.seed)
    a.out.mkdir(parents=True, exist_ok=True)
    digits = (6, 4, 5)
    write_csv(a.out / "training.csv", case.time, case.voltage, case.displacement, digits)
    write_csv(a.out / "heldout.csv", *held.T, digits)
    (a.out / "label.json").write_text(json.dumps(case.label, indent=1) + "\n")
    keys = ("effect", "parameters", "level", "capped", "concealment", "R2", "noise_sd_um")
    print(
        json.dumps({k: case.label[k] for k in keys} | {"residual_um": rms(case.clean - case.refit)})
    )


if __name__ == "__main__":
    main()

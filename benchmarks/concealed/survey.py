"""Which drives separate an effect, and which let the base conceal it: survey.csv, by simulation.

Run: python -m benchmarks.concealed.survey   (about 3 minutes; writes survey.csv beside this file)

Per base, drive and band of rates, every effect at a typical amplitude: `reach`, the visible level
at the amplitude's cap with noise of 0.1 % of the range; `concealment`; and `apart`, the least
1 - ρ² from the other effects. The rows kept are those the design of the exam draws from.
"""

from __future__ import annotations

import csv
from pathlib import Path as File

import numpy as np

from .actuator import Actuator, draw_law, rms
from .drives import Array
from .refit import Chord
from .separability import Off, others, unexplained
from .templates import ORDINARY, TEMPLATES, make_drive
from .truth import BASES, EFFECTS, name_of

BANDS = {"slow": (200, 250, 400, 500), "mid": (1000, 2000, 2500, 4000), "fast": (5e3, 1e4, 2e4)}
FILE = File(__file__).with_name("survey.csv")
SLOW_ONLY = ("creep", "thermal_drift", "gain_drift")
FIELDS = ("role", "effect", "base", "drive", "band", "reach", "concealment", "apart", "closest")


def look(base: str, name: str, band: str, seed: int = 1, samples: int = 4000) -> list[dict]:
    """One actuator: a row per effect."""
    rate = BANDS[band][1]
    drive = make_drive(name, seed, rate, samples)
    actuator = Actuator(base, draw_law(base, drive, seed), drive)
    shape, gains, _ = actuator.absorber.fit(actuator.plain)
    chord, bank = Chord(actuator.absorber, shape, gains), actuator.bank()
    sd = 1e-3 * actuator.scene.stroke
    off, columns, rows = Off(chord, "white", sd), {}, []
    for other in others(seed):
        left = other.left(bank, chord)
        columns[other.name] = off(left / sd)
        key, shape = other.draws[0]
        change = bank.change(key, EFFECTS[key].typical, shape)
        rows.append(
            {"effect": other.name, "base": base, "drive": name, "band": band}
            | {"concealment": 1 - (rms(left[:, 0]) / rms(change)) ** 2}
        )
    return [r | _compare(r["effect"], columns) for r in rows]


def _compare(effect: str, columns: dict[str, Array]) -> dict:
    """Reach, and the nearest other effect."""
    own, e = columns[effect][:, 0], EFFECTS[effect]
    one = own / np.linalg.norm(own)
    apart = {k: unexplained(one, v) for k, v in columns.items() if k != effect}
    closest = min(apart, key=apart.__getitem__)
    reach = rms(own) * e.cap / e.typical
    return {"reach": reach, "apart": apart[closest], "closest": closest}


def choose(rows: list[dict]) -> list[dict]:
    """Rows worth drawing from, per effect and base, each drive once per role."""
    out = []
    for effect in sorted({name_of(r["effect"]) for r in rows}):
        for base in BASES:
            mine = [r for r in rows if (r["effect"], r["base"]) == (effect, base)]
            if effect in SLOW_ONLY:
                mine = [r for r in mine if r["band"] == "slow"]
            seen = sorted(mine, key=lambda r: (min(r["reach"], 3), r["apart"]), reverse=True)
            hidden = [r for r in mine if r["concealment"] >= 0.95 and r["reach"] >= 0.3]
            alike = [r for r in mine if r["apart"] < 0.003 and r["reach"] >= 1]
            for role, some, most in (
                ("separating", seen, 5),
                ("ordinary", [r for r in seen if r["drive"] in ORDINARY], 3),
                ("concealing", sorted(hidden, key=lambda r: -min(r["reach"], 3)), 6),
                ("alike", sorted(alike, key=lambda r: r["apart"]), 3),
            ):
                once: dict[str, dict] = {}
                for r in some:
                    once.setdefault(r["drive"], r)
                out += [r | {"role": role} for r in list(once.values())[:most]]
    return out


def main() -> None:
    """Write survey.csv."""
    rows = []
    for base in BASES:
        for name in TEMPLATES:
            for band in BANDS:
                rows += look(base, name, band)
        print(base, len(rows), flush=True)
    with FILE.open("w", newline="") as f:
        w = csv.DictWriter(f, FIELDS, lineterminator="\n")
        w.writeheader()
        for r in choose(rows):
            w.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in r.items()})


if __name__ == "__main__":
    main()

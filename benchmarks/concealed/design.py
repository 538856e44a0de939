"""The exam's list of cases: balanced, and decided by one master seed before anything is simulated.

| kind | cases | what |
|---|---|---|
| null | 320 | no effect: 4 noises x 4 bases x 20 drives |
| main | 352 | 22 effects x 4 levels x 4 bases; two drives in three separate the effect |
| concealed | 400 | effects and drives of which the base hides nine tenths or more of the power |
| alike | 60 | an effect on a drive where another could pass for it, at level 1 or 3 |
| outside | 80 | truths that are not in the catalogue |
| two | 60 | two effects that are no look-alikes, each at its own level 1 or 3 |
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import cycle, product

import numpy as np

from .build import Spec
from .survey import BANDS, FILE, SLOW_ONLY
from .templates import ALIKE, ORDINARY, TEMPLATES
from .truth import BASES, NAMES, NOISES, OUTSIDE

LEVELS = (0.1, 0.3, 1.0, 3.0)
FRACTION = 1e-3  # noise sd over the range of the base's response
QUIET = 2e-4  # where the effect's range could not show its level otherwise
Rng = np.random.Generator
# Effects that leave marks of different kinds: (drive or response law) with (something else).
PAIRS = (
    ("electrostriction", "mains_interference"),
    ("backlash", "thermal_drift"),
    ("saturation", "creep"),
    ("drive_lag", "thermal_drift"),
    ("resonance", "electrostriction"),
    ("coulomb_friction", "mains_interference"),
    ("minor_loop_memory", "mains_interference"),
    ("slew_rate_limit", "thermal_drift"),
    ("clock_skew", "sensor_nonlinearity"),
    ("lost_contact", "resonance"),
    ("amplitude_dependence", "thermal_drift"),
    ("cubic_nonlinearity", "gain_drift"),
    ("second_mode", "saturation"),
    ("delay", "mains_interference"),
    ("sensor_lag", "electrostriction"),
)


class Survey:
    """Rows of survey.csv by role, effect and base."""

    def __init__(self) -> None:
        with FILE.open(newline="") as f:
            self.rows = list(csv.DictReader(f))

    def __call__(self, role: str, effect: str, base: str | None = None) -> list[dict]:
        bases = BASES if base is None else (base,)
        key = (role, effect)
        return [r for r in self.rows if (r["role"], r["effect"]) == key and r["base"] in bases]


class Draw:
    """Makes specifications; every case has its own seed, drawn from the master seed."""

    def __init__(self, seed: int) -> None:
        self.rng, self.survey = np.random.default_rng(seed), Survey()
        self.specs: list[Spec] = []
        noises = ["white"] * 3 + ["ar", "heavy", "varying"]
        self.noises = cycle(noises)

    def add(
        self,
        kind: str,
        effects: Sequence[str],
        levels: Sequence[float],
        base: str,
        drive: str,
        band: str,
        noise: str | None = None,
        fraction: float = FRACTION,
    ) -> None:
        """One case; a third of those with a drive of the same start get a held-out recording."""
        g = self.rng
        keys = ["creep_kelvin_voigt" if e == "creep" and g.uniform() < 0.4 else e for e in effects]
        weak = bool(levels) and min(levels) <= 0.1
        samples = int(g.choice([6000, 8000] if weak else [2000, 3000, 4000, 6000]))
        alike = next((a for a in ALIKE if drive in a), ())
        others = [d for d in alike if d != drive]
        holdout = str(g.choice(others)) if others and g.uniform() < 0.4 else None
        rate = float(g.choice(BANDS[band]))
        self.specs.append(
            Spec(
                kind, tuple(keys), tuple(levels), base, drive, rate, samples,
                noise or next(self.noises), fraction, int(g.integers(2**31)), holdout,
            )
        )  # fmt: skip

    def band(self, *effects: str) -> str:
        """A band of rates at which the effects can act."""
        slow = any(e in SLOW_ONLY for e in effects)
        return "slow" if slow else str(self.rng.choice(["slow", "mid", "mid", "fast"]))

    def from_row(self, kind: str, row: dict, level: float) -> None:
        """A case on a surveyed drive; quieter where the effect's cap would stay under the level."""
        fraction = FRACTION if float(row["reach"]) >= level else QUIET
        self.add(
            kind, [row["effect"]], [level], row["base"], row["drive"], row["band"],
            fraction=fraction,
        )  # fmt: skip


def nulls(draw: Draw) -> None:
    """No effect, 4 noises x 4 bases x 20 drives."""
    for noise, base in product(NOISES, BASES):
        for k in range(20):
            drive = list(TEMPLATES)[(k + len(draw.specs) // 20) % len(TEMPLATES)]
            draw.add("null", [], [], base, drive, ("slow", "mid", "mid", "fast")[k % 4], noise)


def main(draw: Draw) -> None:
    """Every effect x level x base; drives rotate, two in three from those that separate it."""
    for i, effect in enumerate(NAMES):
        for (j, level), (k, base) in product(enumerate(LEVELS), enumerate(BASES)):
            turn = i + j + 2 * k
            role = "ordinary" if turn % 3 == 2 else "separating"
            rows = draw.survey(role, effect, base)
            if rows:
                draw.from_row("main", rows[turn % len(rows)], level)
            else:  # quantisation leaves its mark on any drive
                drive = ORDINARY[turn % 5] if role == "ordinary" else list(TEMPLATES)[turn % 14]
                draw.add("main", [effect], [level], base, drive, draw.band(effect))


def concealed(draw: Draw, cases: int = 400) -> None:
    """Effects that the base hides: round robin over effects, their surveyed rows, and levels."""
    rows = {e: draw.survey("concealing", e) for e in NAMES}
    for e in rows.values():
        draw.rng.shuffle(e)
    rounds = max(map(len, rows.values()))
    turns = [rows[e][n] for n in range(rounds) for e in rows if n < len(rows[e])]
    levels = cycle(LEVELS)
    for n in range(cases):
        row, level = turns[n % len(turns)], next(levels)
        if n % len(turns) == 0 and n:
            level = next(levels)  # a second round takes other levels
        draw.from_row("concealed", row, level)


def alike(draw: Draw, cases: int = 60) -> None:
    """Drives on which a look-alike passes for the effect."""
    rows = [r for e in NAMES for r in draw.survey("alike", e)]
    picks = draw.rng.permutation(len(rows))
    for n in range(cases):
        row = rows[picks[n % len(rows)]]
        draw.from_row("alike", row, 3.0 if n % 2 and float(row["apart"]) < 5e-4 else 1.0)


def outside(draw: Draw, cases: int = 80) -> None:
    """Truths without a name, at levels .3, 1 and 3."""
    names, bases = list(OUTSIDE), list(BASES)
    for n in range(cases):
        name, base = names[n % len(names)], bases[n // len(names) % 4]
        drive = list(TEMPLATES)[int(draw.rng.integers(len(TEMPLATES)))]
        draw.add("outside", [name], [(1.0, 3.0, 0.3)[n % 3]], base, drive, draw.band())


def two(draw: Draw, cases: int = 60) -> None:
    """Two effects, each at its own visible level, on drives that separate the first or second."""
    bases = list(BASES)
    for n in range(cases):
        pair, base = PAIRS[n % len(PAIRS)], bases[n // len(PAIRS) % 4]
        rows = [r for e in pair for r in draw.survey("separating", e, base)[:3]]
        slow = any(e in SLOW_ONLY for e in pair)
        rows = [r for r in rows if r["band"] == "slow"] or rows if slow else rows
        row = rows[int(draw.rng.integers(len(rows)))]
        levels = [float(draw.rng.choice([1.0, 3.0])) for _ in pair]
        draw.add("two", pair, levels, base, row["drive"], "slow" if slow else row["band"])


def design(seed: int) -> list[Spec]:
    """All cases, shuffled so that a number says nothing."""
    draw = Draw(seed)
    for part in (nulls, main, concealed, alike, outside, two):
        part(draw)
    order = draw.rng.permutation(len(draw.specs))
    return [draw.specs[k] for k in order]


CI = {"null": 30, "main": 36, "concealed": 16, "alike": 6, "outside": 7, "two": 5}


def subset(specs: Sequence[Spec]) -> list[int]:
    """Indices of the 100 cases for CI: per kind, spread over effects, levels and bases."""
    picked = []
    for kind, many in CI.items():
        mine = [k for k, s in enumerate(specs) if s.kind == kind]
        mine.sort(key=lambda k: (specs[k].effects, specs[k].noise, specs[k].levels, specs[k].base))
        picked += [mine[int((n + 0.5) * len(mine) / many)] for n in range(many)]
    return sorted(picked)

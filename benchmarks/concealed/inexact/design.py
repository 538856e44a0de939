"""The list of cases: balanced, and decided by one seed before anything is simulated.

288 cases, 6 for each law, believed model and half.  Of each half's 144 cases 58 have no effect, 10
a static curve alone, 54 one dynamic effect, and 22 two effects, of which the first is dynamic.
The halves are dealt before anything is looked at: one for development, one sealed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from .laws import LAWS
from .signals import SHAPES

BELIEVED = ("bouc_wen", "foh", "lfdh")
HALVES = ("development", "sealed")
RATES = {200.0: 0.25, 500.0: 0.3, 1000.0: 0.25, 2000.0: 0.12, 5000.0: 0.08}  # Hz, share
SAMPLES = (2000, 3000, 4000, 6000, 8000, 10000)
DECK = {"none": 58, "static": 10, "one": 54, "two": 22}
EACH = 6


@dataclass(frozen=True)
class Spec:
    """What a case is to be; everything else is drawn from its seed."""

    number: int
    half: str
    law: str
    believed: str
    content: str
    drive: str
    rate: float
    samples: int
    held_out: bool
    seed: int


def design(seed: int) -> list[Spec]:
    """All cases in an order that says nothing."""
    rng = np.random.default_rng(seed)
    rows = []
    for half in HALVES:
        deck = [content for content, many in DECK.items() for _ in range(many)]
        deck = rng.permutation(deck).tolist()
        for law, believed, _ in product(LAWS, BELIEVED, range(EACH)):
            rows.append((half, law, believed, deck.pop()))
    specs = []
    for number, k in enumerate(rng.permutation(len(rows)).tolist(), start=1):
        half, law, believed, content = rows[k]
        drive = str(rng.choice(list(SHAPES)))
        rate = float(rng.choice(list(RATES), p=list(RATES.values())))
        samples = int(rng.choice(SAMPLES))
        held_out, own = bool(rng.uniform() < 0.5), int(rng.integers(2**31))
        specs.append(
            Spec(number, half, law, believed, content, drive, rate, samples, held_out, own)
        )
    return specs

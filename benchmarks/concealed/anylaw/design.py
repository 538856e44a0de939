"""The list of cases: balanced, and decided by one seed before anything is simulated.

Each law has 8 cases for development and 12 that are sealed: of each half a quarter without an
effect, half with one, a quarter with two; three in ten on the protocol drive; half with a model of
the product that does not have the law, half without a model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .drives import ORDINARY, others
from .laws import HAS, LAWS

BELIEVED = ("foh", "bouc_wen", "prandtl_ishlinskii")
EACH = {"development": 8, "sealed": 12}
CONTENTS = ("none", "one", "two", "one")
RATES = {200.0: 0.3, 500.0: 0.3, 1000.0: 0.2, 2000.0: 0.1, 5000.0: 0.1}  # Hz, share
SAMPLES = (2000, 3000, 4000, 6000, 8000, 10000)
PROTOCOL, LONG, SECOND = 0.3, (22.0, 60.0), 0.2  # share, s, share with two recordings


@dataclass(frozen=True)
class Spec:
    """What a case is to be; everything else is drawn from its seed."""

    number: int
    half: str
    law: str
    believed: str | None
    content: str
    drive: str
    second: str | None
    rate: float
    samples: int
    seed: int


def _dealt(rng: np.random.Generator, deck: list, many: int) -> list:
    """`many` cards of a deck that is repeated, shuffled."""
    return [deck[k % len(deck)] for k in rng.permutation(many).tolist()]


def design(half: str, seed: int) -> list[Spec]:
    """The cases of a half in an order that says nothing."""
    rng = np.random.default_rng(seed)
    many = EACH[half] * len(LAWS)
    laws = _dealt(rng, list(LAWS), many)
    contents, believing = _dealt(rng, list(CONTENTS), many), _dealt(rng, [True, False], many)
    protocols = _dealt(rng, [k < 10 * PROTOCOL for k in range(10)], many)
    specs = []
    for k, law in enumerate(laws):
        believed = [m for m in BELIEVED if law not in HAS.get(m, ())]
        model = str(rng.choice(believed)) if believing[k] else None
        drive = "protocol" if protocols[k] else str(rng.choice(list(ORDINARY)))
        rate = float(rng.choice(list(RATES), p=list(RATES.values())))
        samples = int(rng.choice(SAMPLES))
        if protocols[k]:
            samples = max(samples, 4000)
            rate = float(round(samples / np.exp(rng.uniform(*np.log(LONG)))))
        second = str(rng.choice(others(drive))) if rng.uniform() < SECOND else None
        own = int(rng.integers(2**31))
        specs.append(Spec(k + 1, half, law, model, contents[k], drive, second, rate, samples, own))
    return specs

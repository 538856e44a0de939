"""The measures of the exam, each on the cases it is about."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from .answers import Answer, covered

Pair = tuple[dict, Answer]  # label and answer
DETECTABLE = 25.0  # power of the truth's mark, in noise: detectability sqrt(power) of 5
SEEN = 0.28  # visible .3, less what the search leaves
FAINT = 0.08


@dataclass
class Measure:
    """A number with a 95 % interval, its target, and the cases that missed."""

    name: str
    target: str
    value: float
    low: float
    high: float
    n: int
    failures: list[str] = field(default_factory=list)


def wilson(hits: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    if n == 0:
        return 0.0, 1.0
    z, p = norm.ppf(0.975), hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return float(max(0.0, middle - half)), float(min(1.0, middle + half))


def share(name: str, target: str, pairs: Sequence[Pair], good: Callable[[dict, Answer], bool],
          bad_counts: bool = False) -> Measure:  # fmt: skip
    """Share of cases that are good (or, `bad_counts`, bad); the failures are the bad ones."""
    bad = [x["case"] for x, a in pairs if not good(x, a)]
    hits, n = len(bad) if bad_counts else len(pairs) - len(bad), len(pairs)
    return Measure(name, target, hits / n if n else float("nan"), *wilson(hits, n), n, bad)


def single(pairs: Sequence[Pair], least: float, most: float = np.inf) -> list[Pair]:
    """Cases with one catalogued effect of a visible level in [least, most)."""
    out = []
    for x, a in pairs:
        one = len(x["effects"]) == 1 and x["effects"][0]["catalogued"]
        if one and least <= x["effects"][0]["level"] < most:
            out.append((x, a))
    return out


def truth_of(label: dict) -> dict:
    return label["effects"][0]


def _names(label: dict) -> set[str]:
    return {e["name"] for e in label["effects"] if e["catalogued"]}


def _detectable(pairs: Sequence[Pair]) -> list[Pair]:
    return [p for p in pairs if truth_of(p[0])["power"] >= DETECTABLE]


def inseparable(pairs: Sequence[Pair]) -> list[Pair]:
    """Visible effects that can be detected, but not told from their look-alikes."""
    return [p for p in _detectable(single(pairs, SEEN)) if truth_of(p[0])["look_alikes"]]


def followed(pairs: Sequence[Pair], chance: float = 0.0) -> list[Pair]:
    """The second answers, by the names of their folders, where a record that was said to tell the
    inseparable apart with at least this chance was made."""
    return [
        (x | {"case": f"{x['case']}/after"}, a.after)
        for x, a in inseparable(pairs)
        if a.after and (a.chance or 0.0) >= chance
    ]


def confidently_wrong(label: dict, answer: Answer) -> bool:
    """Names one effect, alone, with a probability of .9 or more, that is not in the truth."""
    if answer.verdict != "missing":
        return False
    sure = [e for e in answer.effects if e["probability"] >= 0.9 and not e["confusable_with"]]
    return any(e["name"] not in _names(label) for e in sure)


def _right_axis(label: dict, answer: Answer) -> bool:
    return answer.axis is not None and answer.axis["axis"] in truth_of(label)["axes"]


def _right_bin(label: dict, answer: Answer) -> bool:
    spot = truth_of(label)["spot"]
    return any(
        low <= spot["value"] <= high
        for a in answer.axes
        if a["axis"] == spot["axis"]
        for low, high in a["intervals"]
    )


def _passes_for(label: dict, answer: Answer) -> bool:
    truth = truth_of(label)
    others = answer.reported & set(truth["look_alikes"])
    return answer.verdict == "confusable" and truth["name"] in answer.reported and bool(others)


def _nameless(pairs: Sequence[Pair]) -> list[Pair]:
    """Outside truths of which no catalogued effect explains nine tenths."""
    out = [p for p in pairs if p[0]["kind"] == "outside"]
    return [p for p in out if truth_of(p[0])["least_lambda"] > 0.1 * truth_of(p[0])["power"]]


def mean_sizes(pairs: Sequence[Pair]) -> list[Measure]:
    """Mean size of the reported set where there is one, of the separable cases alone, and of the
    sets that an answer knowing every law would report: the truth and what could pass for it."""
    there = [(x, a) for x, a in pairs if a.reported]
    apart = [(x, a) for x, a in there if truth_of(x)["separable"]]
    owns = [1 + len(truth_of(x)["look_alikes"]) for x, _ in there]
    return [
        _mean("mean size of the reported set, visible >= .3", "<= 1.5",
              [len(a.reported) for _, a in there]),
        _mean("mean size of the reported set, separable", "", [len(a.reported) for _, a in apart]),
        _mean("mean size of the truth's own set", "", owns),
    ]  # fmt: skip


def _mean(name: str, target: str, sizes: Sequence[int]) -> Measure:
    n = len(sizes)
    mean = float(np.mean(sizes)) if n else float("nan")
    half = 1.96 * float(np.std(sizes, ddof=1)) / np.sqrt(n) if n > 1 else 0.0
    return Measure(name, target, mean, mean - half, mean + half, n)


def heldout(pairs: Sequence[Pair]) -> list[Measure]:
    """Held-out RMSE over that of an oracle that knows the effect and its law, and over that of one
    that knows every number too: medians with their order-statistic intervals, and the shares."""
    kept = [(x, a) for x, a in pairs if x["oracle_rmse_um"] and x["kind"] != "outside"]
    return [
        *_over(kept, "oracle_fit_rmse_um", "the oracle's"),
        *_over(kept, "oracle_rmse_um", "the noise alone"),
    ]


def _over(kept: Sequence[Pair], key: str, name: str) -> list[Measure]:
    ratios = np.sort([a.holdout_um / x[key] for x, a in kept if a.holdout_um])
    n = len(ratios)
    half = 0.98 * np.sqrt(n)
    ends = [int(np.clip(n / 2 + s * half, 0, max(n - 1, 0))) for s in (-1, 1)]
    values = [float(np.median(ratios)), *(float(ratios[k]) for k in ends)] if n else [np.nan] * 3
    median = Measure(f"held-out RMSE over {name}, median", "<= 1.05", *values, n)

    def close(x: dict, a: Answer) -> bool:
        return a.holdout_um is not None and a.holdout_um <= 1.05 * x[key]

    return [median, share(f"held-out RMSE within 1.05 of {name}", "", kept, close)]


def intervals(pairs: Sequence[Pair]) -> Measure:
    """Parameters of rightly named effects within their stated 95 % intervals."""
    flat = []
    for x, a in single(pairs, FAINT):
        if a.first == truth_of(x)["name"]:
            said = covered(truth_of(x), a.effects[0])
            flat += [(x["case"], f"{x['case']}:{k}", v) for k, v in said.items()]
    hits, n = sum(v for *_, v in flat), len(flat)
    missed = [k for _, k, v in flat if not v]
    value = hits / n if n else float("nan")
    name = "parameter in its 95 % interval"
    return Measure(name, ".93 to .97", value, *wilson(hits, n), n, missed)


def calibration(pairs: Sequence[Pair]) -> list[Measure]:
    """Expected calibration error of the first effect's probability."""
    return calibration_of(
        [(a.effects[0]["probability"], a.first in _names(x)) for x, a in pairs if a.effects]
    )


def calibration_of(named: Sequence[tuple[float, bool]], bins: int = 10) -> list[Measure]:
    """Expected calibration error of probabilities beside what was right, with a bootstrap interval;
    and what it would be of exact probabilities, with the range of 95 % of such exams.

    The second is not 0, for in a bin of few cases the share that is right is left to chance.
    """
    name, exact = "calibration error of the probability", "calibration error of exact probabilities"
    if not named:
        return [Measure(name, "<= .05", np.nan, 0.0, 1.0, 0)]
    p, right = np.array(named, float).T

    def error(p: np.ndarray, right: np.ndarray) -> float:
        which = np.minimum((p * bins).astype(int), bins - 1)
        return float(np.sum(np.abs(np.bincount(which, p - right, bins))) / len(p))

    rng, n = np.random.default_rng(0), len(p)
    takes = [rng.integers(n, size=n) for _ in range(400)]
    low, high = np.percentile([error(p[take], right[take]) for take in takes], [2.5, 97.5])
    chance = [error(p, rng.random(n) < p) for _ in range(400)]
    least, most = np.percentile(chance, [2.5, 97.5])
    return [
        Measure(name, "<= .05", error(p, right), float(low), float(high), n),
        Measure(exact, "", float(np.mean(chance)), float(least), float(most), n),
    ]


def measure_all(pairs: Sequence[Pair]) -> list[Measure]:
    """Every measure of the table, in its order."""

    def first(x: dict, a: Answer) -> bool:
        return a.first == truth_of(x)["name"]

    def within(x: dict, a: Answer) -> bool:
        return truth_of(x)["name"] in a.reported

    def apart(p: Pair) -> bool:
        return truth_of(p[0])["separable"]

    def both(x: dict, a: Answer) -> bool:
        return _names(x) <= set(a.names)

    seen, every = single(pairs, SEEN), single(pairs, FAINT)
    two = [p for p in pairs if len(p[0]["effects"]) == 2]
    after = followed(pairs)
    places = [p for p in pairs if len(p[0]["effects"]) == 1]
    places = [p for p in places if truth_of(p[0])["level"] >= SEEN]
    return [
        share("false alarms on nulls", "<= .01", [p for p in pairs if not p[0]["effects"]],
              lambda x, a: a.verdict == "none", True),
        share("first name right, separable, visible >= .3", ">= .97",
              [p for p in seen if apart(p)], first),
        share("first name right, separable, visible .1", ">= .85",
              [p for p in single(pairs, FAINT, SEEN) if apart(p)], first),
        share("truth in the reported set, all levels", ">= .97", every, within),
        share("truth in the reported set, detectable", ">= .97", _detectable(every), within),
        *mean_sizes(seen),
        share("confident and wrong", "<= .01", list(pairs),
              lambda x, a: not confidently_wrong(x, a), True),
        share("inseparable pairs reported as such", ">= .95",
              inseparable(pairs), _passes_for),
        share("right after the recommended record", ">= .90", after, first),
        share("right after a record said to tell them apart", "", followed(pairs, 0.5), first),
        share("truth in the set after the recommended record", "", after, within),
        share("out of catalogue, not named", ">= .95", _nameless(pairs),
              lambda x, a: a.verdict in ("none", "unexplained")),
        share("right axis, visible >= .3", ">= .90", places, _right_axis),
        share("right bin, visible >= .3", ">= .90",
              [p for p in places if truth_of(p[0])["spot"]], _right_bin),
        *heldout(pairs),
        intervals(pairs),
        *calibration(pairs),
        share("two effects, both named", ">= .80", two, both),
        share("two effects, each detectable, both named", "",
              [p for p in two if all(e["power"] >= DETECTABLE for e in p[0]["effects"])], both),
    ]  # fmt: skip

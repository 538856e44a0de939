"""The measures of the third tier, each on the cases, or effects, that it is about.

An effect of an answer is a name and what cannot be told from it.  It is wrong where none of them is
of a truth of the case, nor inseparable from one to the oracle.  An effect of the label is right
where it stands first, or in a set of at most LARGEST_SET; where more than that cannot be told apart
from it, a set of some of these is right too.  Names of the loop's shape are no wrong physics.
Degradation is there in laws that degrade.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..answers import Answer
from ..inexact.kinds import SHAPE, STATIC
from ..inexact.measures import LARGEST_SET
from ..measures import Measure, Pair, calibration_of, share

DETECTABLE, WITHIN = 5.0, 1.1
DEGRADATION = "degradation"
Effects = list[tuple[dict, Answer]]  # of the label, with the case's answer under `one`


def fair(label: Mapping) -> set[str]:
    """Names that are no wrong physics in this case."""
    names = {k for e in label["effects"] for k in (*e["accepted"], *e["accepted_any"])}
    if label["own_path"]:
        names |= {DEGRADATION, *label["own_path"]["alike"]}
    return names | set(SHAPE)


def said(effect: Mapping) -> set[str]:
    """All names of one effect of an answer."""
    return {effect["name"], *effect["confusable_with"]}


def wrong_names(label: Mapping, answer: Answer, passed: Sequence[str] = STATIC) -> set[str]:
    """First names of effects that are not there; static curves are passed over."""
    return {
        e["name"] for e in answer.effects if e["name"] not in passed and not said(e) & fair(label)
    }


def named(effect: Mapping, answer: Answer) -> bool:
    """Whether a label's effect stands first, or in a small set."""
    alike = {*effect["accepted"], *effect["accepted_any"]}
    for e in answer.effects:
        names = said(e)
        small = len(names) <= LARGEST_SET
        if e["name"] == effect["name"] or (small and effect["name"] in names):
            return True
        if len(alike) > LARGEST_SET and len(names) > 1 and names <= alike:
            return True
    return False


def cannot_show(effect: Mapping, answer: Answer) -> bool:
    """Whether the answer says of the effect that this drive cannot show it as small as it is."""
    lines = [x for x in answer.can_show if x["effect"] == effect["name"]]
    return any(x["size"] is None or x["size"] > effect["size_um"] for x in lines)


def by_effect(pairs: Sequence[Pair]) -> list[Pair]:
    """A pair for every effect of the labels, which stands under `one`."""
    return [
        (x | {"one": e, "case": f"{x['case']}:{e['name']}"}, a)
        for x, a in pairs
        for e in x["effects"]
    ]


def shown(pairs: Sequence[Pair], which: str = "detectability_any") -> list[Pair]:
    """A pair for every effect that the recordings show to one who does not know the law."""
    return [p for p in by_effect(pairs) if p[0]["one"][which] >= DETECTABLE]


def right(effects: Sequence[Pair]) -> Measure:
    """Share of effects, a pair each, that are named first or in a small set."""
    name = f"right, detectable whatever the law (first or in a set of {LARGEST_SET})"
    return share(name, ">= .95", effects, lambda x, a: named(x["one"], a))


def invented(pairs: Sequence[Pair]) -> Measure:
    """Share of cases with a name of what is not there."""
    return share(
        "names what is not there", "<= .02", pairs, lambda x, a: not wrong_names(x, a), True
    )


def floors(label: Mapping, answer: Answer) -> float:
    """Residual of the fit in noise floors."""
    residual = np.nan if answer.rms_um is None else answer.rms_um
    return residual / label["noise"]["total_um"]


def nulls(pairs: Sequence[Pair]) -> list[Measure]:
    """Cases without an effect: what is left of them, and whether something is named."""
    still = [p for p in pairs if not p[0]["effects"]]
    reached = [floors(x, a) for x, a in still]
    good = [x for x in reached if np.isfinite(x)]
    ends = (float(np.median(good)), float(np.max(good))) if good else (np.nan, np.nan)
    return [
        share(f"nulls within {WITHIN} noise floors", "1", still,
              lambda x, a: floors(x, a) <= WITHIN),
        Measure("noise floors left of nulls, median (to the largest)", "", ends[0], ends[0],
                ends[1], len(good)),
        share("nulls: none named", "", still, lambda x, a: not wrong_names(x, a)),
    ]  # fmt: skip


def calibration(pairs: Sequence[Pair]) -> list[Measure]:
    """Expected calibration error of named effects; a name of the loop's shape is right."""
    all_named = [(e["probability"], e["name"] in _true(x)) for x, a in pairs for e in a.effects]
    error, *exact = calibration_of(all_named)
    error.target = "<= .04"
    return [error, *exact]


def _true(label: Mapping) -> set[str]:
    own = {DEGRADATION} if label["own_path"] else set()
    return {e["name"] for e in label["effects"]} | own | set(SHAPE)


def measure_all(pairs: Sequence[Pair]) -> list[Measure]:
    """Every measure of the table, in its order."""
    two = [p for p in pairs if len(p[0]["effects"]) == 2]
    apart = [p for p in two if all(e["detectability_any"] >= DETECTABLE for e in p[0]["effects"])]
    hidden = [p for p in by_effect(pairs) if p[0]["one"]["detectability"] < DETECTABLE]
    worn = [p for p in pairs if p[0]["own_path"]]
    worn = [p for p in worn if p[0]["own_path"]["detectability"] >= DETECTABLE]
    return [
        invented(pairs),
        share("the same, static curves too", "", pairs,
              lambda x, a: not wrong_names(x, a, ()), True),
        right(shown(pairs)),
        share("right, detectable to one who knows the kind of memory", "",
              shown(pairs, "detectability"), lambda x, a: named(x["one"], a)),
        share("right in any set, detectable whatever the law", "", shown(pairs),
              lambda x, a: x["one"]["name"] in a.reported),
        share("not detectable: said that the drive cannot show it", "1", hidden,
              lambda x, a: named(x["one"], a) or cannot_show(x["one"], a)),
        share("both of a pair, each detectable beside the other", ">= .85", apart,
              lambda x, a: all(named(e, a) for e in x["effects"])),
        *calibration(pairs),
        *nulls(pairs),
        share("degradation named, where it shows", "", worn,
              lambda x, a: DEGRADATION in a.reported),
        share("no answer", "0", pairs, lambda x, a: a.verdict != "failed", True),
    ]  # fmt: skip

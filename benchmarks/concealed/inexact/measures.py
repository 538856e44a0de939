"""The measures of the second tier, each on the cases it is about.

A name that an answer gives is that of each of its effects, with the verdict `missing` or
`confusable`: of a set of look-alikes it is the first.  A name is right where it is of a truth of
the case or cannot be told from one by the oracle (λ < 25); of a law that depends on the rate
itself, also where it passes for that dependence.  Names of the loop's shape are always right, for
no believed model has the loop's shape.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..answers import Answer
from ..measures import Measure, Pair, calibration_of, share
from .case import DETECTABLE
from .kinds import kind_of

LARGEST_SET = 3


def fair(label: Mapping) -> set[str]:
    """Names that are no wrong physics for this case."""
    names = {k for e in label["effects"] for k in (e["name"], *e["look_alikes"])}
    rate = label["own_rate"]
    if rate and rate["power"] >= DETECTABLE:
        names |= set(rate["alike"])
    return names


def nearly_fair(label: Mapping) -> set[str]:
    """As `fair`, and effects that explain nine tenths of a truth's mark."""
    return fair(label) | {k for e in label["effects"] for k in e["nine_tenths"]}


def wrong_physics(label: Mapping, answer: Answer, kinds: Sequence[str] = ("dynamic",)) -> set[str]:
    """Names of these kinds that are neither there nor inseparable from what is."""
    return {k for k in answer.names if kind_of(k) in kinds} - fair(label)


def has_dynamics(label: Mapping) -> bool:
    """Whether an effect of the case is dynamic."""
    return any(e["kind"] == "dynamic" for e in label["effects"])


def names_it(effect: Mapping, answer: Answer) -> bool:
    """Whether an effect stands first, or in a set of at most LARGEST_SET."""
    return any(
        effect["name"] == e["name"]
        or (effect["name"] in e["confusable_with"] and 1 + len(e["confusable_with"]) <= LARGEST_SET)
        for e in answer.effects
    )


def by_effect(pairs: Sequence[Pair], kind: str) -> list[Pair]:
    """A pair for every effect of a kind, whose label has that effect alone under `one`."""
    return [
        (x | {"one": e, "case": f"{x['case']}:{e['name']}"}, a)
        for x, a in pairs
        for e in x["effects"]
        if e["kind"] == kind
    ]


def separable(pairs: Sequence[Pair]) -> list[Pair]:
    """A pair for every dynamic effect that the oracle separates from all others."""
    return [p for p in by_effect(pairs, "dynamic") if p[0]["one"]["separable"]]


def dynamics_named(effects: Sequence[Pair]) -> Measure:
    """Share of effects, a pair each, that are named first or in a small set."""
    name = f"dynamic effect first or in a set of {LARGEST_SET}, separable"
    return share(name, ">= .85", effects, lambda x, a: names_it(x["one"], a))


def shares(pairs: Sequence[Pair]) -> list[Measure]:
    """The measures that are shares of cases, or of effects."""
    still = [p for p in pairs if not has_dynamics(p[0])]
    rate_free = [p for p in still if not p[0]["own_rate"]]
    apart = separable(pairs)
    outside = [p for p in apart if not p[0]["one"]["beyond_shape"]["look_alikes"]]
    outside = [p for p in outside if p[0]["one"]["beyond_shape"]["level"] >= 1]

    def none_wrong(x: dict, a: Answer) -> bool:
        return not wrong_physics(x, a)

    return [
        share("physics named that is not there", "<= .03", pairs, none_wrong, True),
        share("the same, static curves too", "", pairs,
              lambda x, a: not wrong_physics(x, a, ("dynamic", "static")), True),
        share("the same, but for what explains nine tenths", "", pairs,
              lambda x, a: wrong_physics(x, a) <= nearly_fair(x), True),
        dynamics_named(apart),
        share("the same, visible >= 1 beyond any loop shape", "", outside,
              lambda x, a: names_it(x["one"], a)),
        share("dynamic effect in any set, separable", "", apart,
              lambda x, a: x["one"]["name"] in a.reported),
        share("no dynamics: none named", ">= .95", still, none_wrong),
        share("no dynamics, law without rate: none named", ">= .95", rate_free, none_wrong),
        share("static curve named, or told as shape", "", by_effect(pairs, "static"),
              lambda x, a: names_it(x["one"], a) or any(kind_of(k) == "shape" for k in a.names)),
        share("no answer", "0", pairs, lambda x, a: a.verdict != "failed", True),
    ]  # fmt: skip


def calibration(pairs: Sequence[Pair]) -> list[Measure]:
    """Expected calibration error over every named effect, and over those that are no shape."""
    said = [
        (e["probability"], kind_of(e["name"]) == "shape" or e["name"] in fair(x), e["name"])
        for x, a in pairs
        for e in a.effects
    ]
    return [
        *calibration_of([(p, right) for p, right, _ in said]),
        *(
            Measure(f"{m.name}, no shape", "", m.value, m.low, m.high, m.n)
            for m in calibration_of([(p, right) for p, right, k in said if kind_of(k) != "shape"])
        ),
    ]


def measure_all(pairs: Sequence[Pair]) -> list[Measure]:
    """Every measure of the table, in its order."""
    return [*shares(pairs), *calibration(pairs)]

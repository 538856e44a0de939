"""The diagnosis in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .._prepare import Noise
from ._next_experiment import LIKELY, Proposal
from ._result import Axis, HeldOut, NextExperiment, Verdict
from ._shape import HYSTERESIS_SHAPE, entry_of
from ._thresholds import SIGNIFICANCE

if TYPE_CHECKING:
    from ._findings import Findings

_CLEARLY = 0.4
_FAR = 2.0
"""Noise floors from which on an error on data held out is remarked on."""
_MOST_TOLD = 4


def where_of(
    axes: Sequence[Axis],
    verdict: Verdict,
    named: Sequence[str] = (),
    left: Sequence[tuple[str, float]] = (),
) -> str:
    """One sentence on the place: the first axis that stands out, and its strongest stretch; and,
    where it is another, where the effects that are `named` act.  Of several recordings another
    sentence: what is `left` in each, by its name, in noise floors."""
    standing_out = [axis for axis in axes if axis.p_value < SIGNIFICANCE]
    if verdict == "none":
        return "Nowhere does the residual stand out from the noise."
    among = _among(left) if len(left) > 1 else ""
    acting = ""
    if named and axes[0].p_value >= SIGNIFICANCE and axes[0].intervals:
        acting = f"; what {' and '.join(named)} changes lies along {_place(axes[0])}"
    if not standing_out:
        return f"The mismatch stands out along no axis{acting}.{among}"
    others = ", ".join(other.axis for other in standing_out[1:4])
    also = f"; it also shows along {others}" if others else ""
    return f"The mismatch stands out along {_place(standing_out[0])}{also}{acting}.{among}"


def _among(left: Sequence[tuple[str, float]]) -> str:
    """How much is left in each of several recordings, first where it is most."""
    ranked = sorted(left, key=lambda pair: -pair[1])
    (first, most), *others = ranked[:_MOST_TOLD]
    told = [f"{times:.2g} in {name}" for name, times in others]
    if len(ranked) > _MOST_TOLD:
        told.append(f"at most {ranked[_MOST_TOLD][1]:.2g} elsewhere")
    return f" What is left is {most:.2g} times the noise in {first}, {', '.join(told)}."


def _place(axis: Axis) -> str:
    """An axis, and where on it."""
    stretches = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in axis.intervals[:3])
    unit = "" if axis.unit == "1" else f" {axis.unit}"
    return axis.axis + (f", at {stretches}{unit}" if axis.intervals else " as a whole")


def sentence_of(findings: Findings, most_like: str | None) -> str:
    """The plain sentence that everything else supports, after what is wrong with the recording."""
    if findings.doubts:
        return f"{' '.join(findings.doubts)} Until then no missing physics is named."
    base, verdict = findings.base_fit, findings.verdict
    several = len(base.preparation.takes) > 1
    recorded = "the recordings" if several else "the recording"
    if verdict == "none":
        return _agreement(findings, recorded)
    shape = "" if findings.shape is None else f" {findings.shape.summary}."
    smaller = ""
    if most_like is not None:
        smaller = f" Something smaller is left, most like {most_like}, too small a share to name."
    if verdict == "unexplained":
        place = where_of(findings.axes, verdict).removeprefix("The mismatch stands out ")
        if all(axis.p_value >= SIGNIFICANCE for axis in findings.axes):
            place = "all over, nowhere in particular."
        like = f" It is most like {most_like}." if most_like is not None else ""
        return (
            f"{base.model.name} and {recorded} differ beyond noise {place.rstrip('.')}, and no "
            f"effect of the catalogue explains it.{shape}{like}"
        )
    return f"{_named(findings)}{shape}{_improvement(findings)}{smaller}"


def _named(findings: Findings) -> str:
    """What the model leaves out."""
    name, effects = findings.base_fit.model.name, findings.effects
    dynamic = [e for e in effects if e.name != HYSTERESIS_SHAPE.name]
    if not dynamic:
        return f"{name}'s loop is not the actuator's, and no other physics stands out beside that."
    parts = " and ".join(f"{e.name} ({entry_of(e.name).sentence})" for e in dynamic)
    others = sorted({other for e in dynamic for other in e.confusable_with})
    if others:
        return f"{name} leaves out {parts}, or what this drive cannot tell from it: " + (
            f"{', '.join(others)}."
        )
    return f"{name} leaves out {parts}."


def _improvement(findings: Findings) -> str:
    """What the extended model makes of data held out."""
    held_out, noise = findings.held_out, findings.noise
    if held_out.extended_rmse is None:
        return ""
    falls = "falls" if held_out.extended_rmse <= held_out.base_rmse else "rises"
    improvement = (
        f" With it the error on data held out {falls} from {held_out.base_rmse:.3g} to "
        f"{held_out.extended_rmse:.3g} {noise.unit} (noise floor {noise.sigma:.3g} {noise.unit})."
    )
    times = held_out.extended_rmse / noise.sigma
    if times > _FAR:
        improvement += (
            f" That is still {times:.2g} times the noise: more is missing, or the training "
            "leaves the numbers too open to predict it."
        )
    return improvement


def _agreement(findings: Findings, recorded: str) -> str:
    """That nothing is missing, as far as can be seen."""
    base, noise, held_out = findings.base_fit, findings.noise, findings.held_out
    name = base.model.name
    floor = f"the noise floor of {noise.sigma:.3g} {noise.unit} ({noise.method})"
    if noise.method == "residual":
        return (
            f"No effect stands out from what {name} leaves, but that residual is all there is "
            "to judge the noise by, so a mismatch cannot be excluded; record repeats or a rest."
        )
    if findings.excess > max(findings.doubt, _CLEARLY):
        return (
            f"Nothing stands out from what {name} leaves; yet that is {base.scores.rmse:.3g} "
            f"{noise.unit} where {floor} would be left. Either a few samples are outliers, or the "
            "noise has tails that so little of it does not show: record repeats or a longer "
            "rest, or leave out the times of the outliers (--mask)."
            + _shown_elsewhere(held_out, noise)
        )
    hidden = max(findings.candidates, key=lambda c: c.concealment)
    seen = f"which {name} takes up whole on such a drive"
    if hidden.is_seen_within(base.preparation.setting.response_span):
        least = f"{hidden.detectable_amplitude:.3g} {noise.unit} rms"
        seen = f"seen only if it changes the response by more than {least}"
    return (
        f"{name} and {recorded} agree within {floor}; best hidden would be "
        f"{hidden.name}, {seen}.{_shown_elsewhere(held_out, noise)}"
    )


def _shown_elsewhere(held_out: HeldOut, noise: Noise) -> str:
    """What is to be said of a recording held out that a base without mismatch does not predict."""
    times = held_out.base_rmse / noise.sigma
    if held_out.method != "recording" or times <= _FAR:
        return ""
    return (
        f" But it is {held_out.base_rmse:.3g} {noise.unit} off on the recording held out, "
        f"{times:.2g} times the noise: that shows what this one does not, or this one leaves the "
        "numbers too open to predict it; diagnose both together."
    )


def advice(one: str, other: str) -> str | None:
    """What the catalogue says separates two effects."""
    return entry_of(one).separated_by.get(other) or entry_of(other).separated_by.get(one)


def next_experiment(names: Sequence[str], proposal: Proposal) -> NextExperiment:
    """The proposed drive, with what to expect of it."""
    first, drive = names[0], proposal.drive
    told = [names[k] for k in proposal.told]
    rest = [name for name in names[1:] if name not in told]
    parted, left = " and ".join(told), " and ".join(rest)
    chance = proposal.probability
    probability = f"{chance:.2f}" if chance >= 0.01 else "less than 0.01"
    if chance < LIKELY:
        sentence = (
            f"No drive within the limits is likely to tell {first} from {parted}: the best of "
            f"them, {drive.description}, does so with a probability of {probability}. "
        )
        known = advice(first, told[0])
        remedy = "Wider limits, less noise or a longer recording may help."
        sentence += f"Better would be {known}." if known else remedy
    else:
        sentence = (
            f"Record {drive.description}: it tells {first} from {parted} with a probability of "
            f"{probability}."
        )
        if rest:
            sentence += f" No one drive within the limits is likely to tell it from {left} too"
            known = advice(first, rest[0])
            sentence += f"; better for that would be {known}." if known else "."
        elif not proposal.all_apart:
            sentence += f" What tells {parted} apart too is not among the drives within the limits."
    return NextExperiment(sentence, (first, *told), chance, drive)

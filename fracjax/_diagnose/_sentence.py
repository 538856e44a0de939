"""The diagnosis in words."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._fit import Fit
from .._path import Visible
from .._prepare import Noise
from .._protocol import Drive
from .._show import quantity
from ._next_experiment import LIKELY, Proposal
from ._result import Axis, HeldOut, NextExperiment, Verdict
from ._shape import HYSTERESIS_SHAPE, entry_of
from ._thresholds import SIGNIFICANCE

if TYPE_CHECKING:
    from ._findings import Findings

_CLEARLY = 0.4
"""Excess of χ² per sample above which a residual without a significant effect is not called
agreement; chosen by judgement."""
_FAR = 2.0
"""Ratio of an error to the noise above which the sentence mentions it; chosen by judgement."""
_LEFT = 1.3
"""Noise floors that even path curves leave above which the sentence mentions it; chosen by
judgement."""
_GAIN = 1.5
"""How many times as small a size a further drive must show to be mentioned; chosen by judgement."""
_ORDERS = {
    "time": "time",
    "phase": "the phase of the cycle",
    "frequency": "frequency",
    "level": "the level of the drive",
    "rate": "the rate of the drive",
    "reversal": "the time since a reversal",
    "harmonics": "the harmonic of the drive",
}
"""By axis, what samples were ordered by."""
_MOST_LISTED = 4
"""Recordings whose residual is listed at most; chosen by judgement."""


def where_of(
    axes: Sequence[Axis],
    verdict: Verdict,
    named: Sequence[str] = (),
    residuals: Sequence[tuple[str, float]] = (),
) -> str:
    """One sentence on the place of the mismatch: the first axis that stands out, with its strongest
    stretch, and where the `named` effects act, if that is another place.

    For several recordings a second sentence follows: the `residuals`, each the name of a recording
    and the rms of its residual over its noise level.
    """
    standing_out = [axis for axis in axes if axis.p_value < SIGNIFICANCE]
    if verdict == "none":
        return "The residual does not exceed the noise anywhere."
    among = _among(residuals) if len(residuals) > 1 else ""
    acting = ""
    if named and axes[0].p_value >= SIGNIFICANCE and axes[0].intervals:
        acting = f"; the changes by {' and '.join(named)} depend on {_place(axes[0])}"
    if not standing_out:
        return f"The mismatch depends on nothing in particular{acting}.{among}"
    others = ", ".join(_ORDERS[other.axis] for other in standing_out[1:4])
    also = f"; it also depends on {others}" if others else ""
    return f"The mismatch depends on {_place(standing_out[0])}{also}{acting}.{among}"


def _among(residuals: Sequence[tuple[str, float]]) -> str:
    """The residual in each of several recordings, over its noise level, the largest first."""
    ranked = sorted(residuals, key=lambda pair: -pair[1])
    (first, most), *others = ranked[:_MOST_LISTED]
    listed = [f"{times:.2g} in {name}" for name, times in others]
    if len(ranked) > _MOST_LISTED:
        listed.append(f"at most {ranked[_MOST_LISTED][1]:.2g} elsewhere")
    return f" The residual is {most:.2g} times the noise in {first}, {', '.join(listed)}."


def _place(axis: Axis) -> str:
    """An axis and the stretches on it, in words."""
    stretches = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in axis.intervals[:3])
    unit = "" if axis.unit == "1" else f" {axis.unit}"
    return _ORDERS[axis.axis] + (f", most at {stretches}{unit}" if axis.intervals else "")


def sentence_of(findings: Findings) -> str:
    """The diagnosis in plain words, or the reasons why the recording cannot be diagnosed."""
    if findings.doubts:
        return f"{' '.join(findings.doubts)} Until then no effect is named."
    if findings.inquiry.model is None:
        return _dynamics(findings)
    base, verdict = findings.base_fit, findings.verdict
    recorded = _recorded(findings)
    if verdict == "none":
        return _agreement(findings, recorded)
    if verdict == "missing" or verdict == "confusable":
        shape = "" if findings.shape is None else f" {findings.shape.summary}."
        return f"{_named(findings)}{shape}{_improvement(findings)}{_remaining(findings)}"
    place = where_of(findings.axes, verdict).removeprefix("The mismatch ")
    jumps = f" {findings.jumps}" if findings.jumps else ""
    useless = ""
    if findings.follows_nothing:
        useless = f" Begin with another model: {base.shortcomings[0]}."
    return (
        f"{base.model.name} and {recorded} differ by more than the noise, and no effect of the "
        f"catalogue explains it; the difference {place}{jumps}{useless}{_remaining(findings)}"
    )


def _recorded(findings: Findings) -> str:
    """The recording or the recordings, in words."""
    return "the recordings" if len(findings.base.preparation.takes) > 1 else "the recording"


def _dynamics(findings: Findings) -> str:
    """The sentence where no model is asked about."""
    recorded, noise = _recorded(findings), findings.noise
    shows = "show" if recorded.endswith("s") else "shows"
    floors = np.sqrt(1 + max(findings.inquiry.path_misfit, 0.0))
    whatever = "Whatever law of hysteresis the actuator has"
    if findings.effects:
        return f"{whatever}, {recorded} {shows} {_listed(findings)}.{_remaining(findings)}"
    if findings.verdict == "none":
        return (
            f"{whatever}, {recorded} {shows} no dynamics beyond the "
            f"noise floor of {quantity(noise.sigma, noise.unit)} ({noise.method}); what the drive "
            "could not have shown is listed."
        )
    return (
        f"No rate-independent law of hysteresis describes {recorded}, whatever its shape: "
        f"{floors:.2g} times the noise is left, and no effect of the catalogue explains it."
    )


def _remaining(findings: Findings) -> str:
    """The sentence on what even path curves with the named effects leave, or ""."""
    if findings.inquiry.is_adequate:
        return ""
    floors = np.sqrt(1 + max(findings.inquiry.path_misfit, 0.0))
    if floors < _LEFT:
        return ""
    return (
        f" Beside any law of hysteresis {floors:.2g} times the noise is left, which nothing here "
        "explains."
    )


def _listed(findings: Findings) -> str:
    """The named effects with their physics and their look-alikes."""
    physical = [e for e in findings.effects if e.name != HYSTERESIS_SHAPE.name]
    parts = " and ".join(f"{e.name} ({entry_of(e.name).sentence})" for e in physical)
    others = sorted({other for e in physical for other in e.confusable_with})
    if others:
        parts += f", or an effect that this drive cannot distinguish from it: {', '.join(others)}"
    return parts


def _named(findings: Findings) -> str:
    """The sentence on the effects that the model leaves out."""
    name = findings.base_fit.model.name
    if all(e.name == HYSTERESIS_SHAPE.name for e in findings.effects):
        return (
            f"The hysteresis loop of {name} does not have the actuator's shape; no other effect is "
            "significant."
        )
    return f"{name} leaves out {_listed(findings)}."


def _improvement(findings: Findings) -> str:
    """The sentence on the extended model's error on held-out data, or ""."""
    held_out, noise = findings.held_out, findings.noise
    if held_out.extended_rmse is None:
        return ""
    falls = "falls" if held_out.extended_rmse <= held_out.base_rmse else "rises"
    improvement = (
        f" With it the error on held-out data {falls} from {held_out.base_rmse:.3g} to "
        f"{quantity(held_out.extended_rmse, noise.unit)} (noise floor "
        f"{quantity(noise.sigma, noise.unit)})."
    )
    times = held_out.extended_rmse / noise.sigma
    if times > _FAR:
        improvement += (
            f" That is still {times:.2g} times the noise: more is missing, or the training data do "
            "not determine the parameters well enough to predict it."
        )
    return improvement


def _agreement(findings: Findings, recorded: str) -> str:
    """The sentence on a residual without a significant effect, and what it could hide."""
    base, noise, held_out = findings.base_fit, findings.noise, findings.held_out
    name = base.model.name
    floor = f"the noise floor of {quantity(noise.sigma, noise.unit)} ({noise.method})"
    if noise.method == "residual":
        return (
            f"No effect is significant in the residual of {name}, but the noise level was "
            "estimated from that same residual, so a mismatch cannot be excluded; record repeats "
            "or a rest."
        )
    # Coloured noise may hide a slow residual that is far above its level.
    is_far = base.scores.rmse > _FAR * noise.sigma
    if is_far or findings.excess > max(findings.doubt, _CLEARLY):
        return (
            f"No effect is significant in the residual of {name}, but the residual is "
            f"{quantity(base.scores.rmse, noise.unit)}, more than {floor}. Either a few samples "
            "are outliers, or the noise is slower or has heavier tails than the short sample of it "
            "shows: record repeats or a longer rest, or leave out the times of the outliers "
            "(--mask)." + _shown_elsewhere(held_out, noise)
        )
    hidden = max(findings.candidates, key=lambda c: c.concealment)
    limit = f"which {name} absorbs completely on such a drive"
    if hidden.is_seen_within(base.preparation.setting.response_span):
        least = f"{quantity(hidden.detectable_amplitude, noise.unit)} rms"
        limit = f"detectable only if it changes the response by more than {least}"
    return (
        f"{name} and {recorded} agree within {floor}; the effect that could hide best is "
        f"{hidden.name}, {limit}.{_shown_elsewhere(held_out, noise)}"
    )


def _shown_elsewhere(held_out: HeldOut, noise: Noise) -> str:
    """The sentence on a held-out recording that a base without mismatch does not predict, or ""."""
    times = held_out.base_rmse / noise.sigma
    if held_out.method != "recording" or times <= _FAR:
        return ""
    return (
        f" But its error on the held-out recording is {quantity(held_out.base_rmse, noise.unit)}, "
        f"{times:.2g} times the noise: that recording shows an effect that this one does not, or "
        "this one does not determine the parameters well enough to predict it; diagnose both "
        "together."
    )


def is_incomplete(findings: Findings) -> bool:
    """Whether more is missing than the names explain, in a recording that can be diagnosed."""
    if findings.doubts or findings.verdict == "none":
        return False
    extended = findings.held_out.extended_rmse
    remains = extended is not None and extended > _FAR * findings.noise.sigma
    return findings.verdict == "unexplained" or remains


def advice(one: str, other: str) -> str | None:
    """The experiment that separates two effects, by the catalogue; None if it lists none."""
    return entry_of(one).separated_by.get(other) or entry_of(other).separated_by.get(one)


def next_experiment(names: Sequence[str], proposal: Proposal) -> NextExperiment:
    """The proposed drive, with the effects that it separates and with which probability."""
    first, drive = names[0], proposal.drive
    distinguished = [names[k] for k in proposal.distinguished]
    rest = [name for name in names[1:] if name not in distinguished]
    parted, undistinguished = " and ".join(distinguished), " and ".join(rest)
    chance = proposal.probability
    probability = f"{chance:.2f}" if chance >= 0.01 else "less than 0.01"
    if chance < LIKELY:
        sentence = (
            f"No drive within the limits is likely to distinguish {first} from {parted}: the best "
            f"of them, {drive.description}, does so with a probability of {probability}. "
        )
        experiment = advice(first, distinguished[0])
        remedy = "Wider limits, less noise or a longer recording may help."
        sentence += f"Better would be {experiment}." if experiment else remedy
    else:
        sentence = (
            f"Record {drive.description}: there {first} differs from what {parted} could make of "
            f"it by {proposal.difference:.2g} noise floors rms or more, which distinguishes them "
            f"with a probability of {probability}."
        )
        if rest:
            sentence += (
                " No single drive within the limits is likely to distinguish it from "
                f"{undistinguished} as well"
            )
            experiment = advice(first, rest[0])
            sentence += f"; better for that would be {experiment}." if experiment else "."
        elif not proposal.all_apart:
            sentence += (
                f" None of the drives within the limits also distinguishes {parted} from each "
                "other."
            )
    return NextExperiment(sentence, (first, *distinguished), chance, drive)


def completed_sentence(
    drive: Drive, shows: Sequence[Visible], both: Sequence[Visible]
) -> NextExperiment:
    """The designed drive where no effect of the catalogue explains what remains, with what it shows
    and these recordings do not."""
    before = {one.effect: one for one in shows}
    gains = [
        (one, before[one.effect].size)
        for one in both
        if one.size is not None and one.effect in before
    ]
    news = [one for one, own in gains if own is None or own > _GAIN * (one.size or 0.0)]
    seen = ", ".join(f"{one.effect} from {quantity(one.size or 0.0, one.unit)}" for one in news)
    shown = (
        f"it shows {seen}, peak to peak, which this recording does not"
        if news
        else "it shows no effect from a much smaller size than this recording, but repeats its path"
    )
    parts = ", ".join(dict.fromkeys(part.name for part in drive.parts))
    sentence = f"Record {drive.description} ({parts}), whatever the hysteresis: {shown}."
    return NextExperiment(sentence, (), None, drive)


def afterwards(experiment: NextExperiment, fit: Fit) -> NextExperiment:
    """The proposal with what to do with the recording: the command, where the recordings of the fit
    are files."""
    sources = [take.recording.source for take in fit.preparation.takes]
    command = ""
    if all(Path(source).is_file() for source in sources):
        words = ["fracjax", "diagnose", *sources, "RECORDED.csv", "--model", fit.model.name]
        command = f": {shlex.join([*words, '--out', 'both'])}, with the options of this call"
    sentence = f"{experiment.sentence} Then diagnose both together{command}."
    return replace(experiment, sentence=sentence)

"""One case: a recording, for some a held-out one, and a label that says what is in it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..actuator import rms
from ..build import Made
from ..drives import Array, Drive
from ..separability import SEPARABLE
from ..templates import floor_of
from ..truth import EFFECTS, Effect, name_of
from .design import Spec
from .kinds import FAMILIES, FAMILY_SHARES, MODE_RATE, SLEW, family_of, kind_of
from .laws import LAWS, drawn
from .noises import Noise, draw_noise
from .oracle import Oracle
from .rivals import ALIKE, Rivals, beyond_shape, look_alikes, off
from .signals import BOTTOM, make_drive, others
from .stage import HISTORIES, Pairs, Stage, history

RATED = ((0.0, 100.0), (0.0, 150.0), (-20.0, 120.0), (-100.0, 100.0), (-30.0, 130.0))
FAINTEST, LOUDEST, LARGEST = 1.0, 12.0, 0.015  # noise sd, noise sd, stroke
SEEN = 0.5  # noise sd that an effect must reach, or another is drawn
DETECTABLE = 25.0  # power of a mark that can be told from noise
NAMES_TRIED, SHAPES_EACH = 12, 2
Rng = np.random.Generator


@dataclass(frozen=True)
class Chosen:
    """An effect at its amplitude, and what it leaves after the oracle, in um."""

    key: str
    effect: Effect
    params: dict
    amplitude: float
    residual: Array

    @property
    def name(self) -> str:
        return name_of(self.key)


def draw_stage(spec: Spec) -> tuple[Stage, str]:
    """The case's stage on its drive, and the kind of its history."""
    rng = np.random.default_rng([spec.seed, 1])
    law = LAWS[spec.law]
    params, swing = drawn(law, rng)
    stroke = float(np.exp(rng.uniform(np.log(5), np.log(50))))
    rated = RATED[int(rng.integers(len(RATED)))]
    share = rng.uniform(0.6, 1.0)
    low = rated[0] + rng.uniform(0, 1 - share) * (rated[1] - rated[0])
    volts = (low, low + share * (rated[1] - rated[0]))
    drive = make_drive(spec.drive, spec.seed, spec.rate, spec.samples, volts)
    kind = str(rng.choice(HISTORIES, p=(0.5, 0.3, 0.2)))
    before = _before(kind, drive, rated)
    return Stage(law, params, stroke / swing, rated, drive, before), kind


def _before(kind: str, drive: Drive, rated: tuple[float, float]) -> Array:
    start = float(drive(np.zeros(1))[0])
    return history(kind, (2 * start - rated[0] - rated[1]) / (rated[1] - rated[0]))


def choose(oracle: Oracle, families: Collection[str], rng: Rng) -> Chosen:
    """An effect of one of the families that the recording shows, at a drawn visible level.

    The level is the rms after the oracle, between FAINTEST noise sd and the larger of LOUDEST of
    them and LARGEST of the stroke, evenly in the logarithm, within the effect's physical range.
    An effect that the recording does not show at SHAPES_EACH shapes gives way to another.
    """
    stage, sd = oracle.stage, oracle.noise.total
    shares = np.array([FAMILY_SHARES[family] for family in families])
    loudest = max(LOUDEST * sd, LARGEST * stage.scene.stroke)
    faint = []
    for _ in range(NAMES_TRIED):
        name = str(rng.choice(FAMILIES[str(rng.choice(list(families), p=shares / shares.sum()))]))
        if not possible(name, stage):
            continue
        key = "creep_kelvin_voigt" if name == "creep" and rng.uniform() < 0.4 else name
        for _ in range(SHAPES_EACH):
            wanted = float(np.exp(rng.uniform(np.log(FAINTEST * sd), np.log(loudest))))
            chosen = scale(oracle, key, EFFECTS[key].shape(rng), wanted)
            if rms(chosen.residual) >= SEEN * sd:
                return chosen
            faint.append(chosen)
    return max(faint, key=lambda chosen: rms(chosen.residual))


def possible(name: str, stage: Stage) -> bool:
    """Whether the rate can hold a mode, and an amplifier could be too slow for the drive."""
    if family_of(name) == "mode":
        return stage.drive.rate >= MODE_RATE
    return name != "slew_rate_limit" or stage.scene.speed >= SLEW


def scale(oracle: Oracle, key: str, shape: dict, wanted: float) -> Chosen:
    """The effect at the amplitude that leaves `wanted` um after the oracle, or at its cap.

    Secants in the logarithms; a tenth off is near enough.
    """
    e, stage = EFFECTS[key], oracle.stage
    plain, a, power, tries = stage.recorded([]), e.typical, 1.0, []
    for _ in range(7):
        params = e.parameters(a, shape, stage.scene)
        residual = oracle.left(stage.recorded([(e, params)]), steps=1)
        level = max(rms(residual), 1e-9 * rms(plain))
        tries.append((abs(np.log(level / wanted)), a, level, params))
        if tries[-1][0] < 0.1 or (a >= e.cap and level < wanted):
            break
        if len(tries) > 1:
            bend = np.log(level / tries[-2][2]) / np.log(a / tries[-2][1])
            power = float(np.clip(bend, 0.4, 8.0))
        a = min(e.cap, a * float(np.exp(np.clip(np.log(wanted / level) / power, -4, 4))))
        if a == tries[-1][1]:
            break
    _, a, _, params = min(tries, key=lambda x: x[0])
    return Chosen(key, e, params, a, oracle.left(stage.recorded([(e, params)])))


def content(oracle: Oracle, spec: Spec) -> list[Chosen]:
    """The effects of a case: none, a static curve, one dynamic, or two of two families."""
    rng = np.random.default_rng([spec.seed, 2])
    dynamic = [family for family in FAMILIES if family != "static"]
    if spec.content == "none":
        return []
    if spec.content == "static":
        return [choose(oracle, ["static"], rng)]
    first = choose(oracle, dynamic, rng)
    if spec.content == "one":
        return [first]
    beside = [family for family in FAMILIES if family != family_of(first.name)]
    return [first, choose(oracle, beside, rng)]


def build(spec: Spec) -> Made:
    """Simulate a case and label it."""
    stage, kind = draw_stage(spec)
    noise = draw_noise(np.random.default_rng([spec.seed, 4]), stage.scene.stroke)
    oracle, rivals = Oracle(stage, noise), Rivals(stage, noise, spec.seed)
    effects = content(oracle, spec)
    pairs: Pairs = [(c.effect, c.params) for c in effects]
    clean = stage.recorded(pairs)
    wide = beyond_shape(stage.drive(stage.drive.times), oracle.tangent, noise)
    label = {
        "case": f"case_{spec.number:04d}",
        "half": spec.half,
        "base": spec.law,
        "base_parameters": dict(stage.params),
        "believed": spec.believed,
        "effects": [truth(c, oracle, rivals, wide) for c in effects],
        "own_rate": own_rate(stage, noise, spec.seed),
        "drive": spec.drive,
        "history": kind,
        "rate_Hz": spec.rate,
        "samples": len(clean),
        "rated_V": list(stage.rated),
        "stroke_um": stage.scene.stroke,
        "opening": opening_of(stage),
        "noise": {"colour": noise.colour, "sd_um": noise.sd, "order": noise.order,
                  "total_um": noise.total},
        "floor": floor_of(stage.drive),
        "rests_s": [list(ends) for ends in stage.drive.rests],
        "period_s": stage.drive.period,
    }  # fmt: skip
    recording = _measured(stage, clean, noise, np.random.default_rng([spec.seed, 11]))
    holdout = held_out(spec, stage, kind, noise, pairs) if spec.held_out else None
    label["holdout"] = f"{label['case']}.holdout.csv" if spec.held_out else None
    return Made(recording, holdout, label)


def opening_of(stage: Stage) -> float:
    """Widest opening of the loop on this drive over the stroke, in 40 bins of the drive."""
    u, y = stage.u, stage.plain
    bins = np.minimum(((u - u.min()) / np.ptp(u) * 40).astype(int), 39)
    inside = [np.ptp(y[bins == k] - np.polyval(np.polyfit(u, y, 1), u[bins == k]))
              for k in range(40) if np.any(bins == k)]  # fmt: skip
    return float(max(inside) / np.ptp(y))


def _measured(stage: Stage, clean: Array, noise: Noise, rng: Rng) -> Array:
    times = stage.drive.times
    y = noise.recorded(clean + noise.sample(len(clean), rng))
    return np.column_stack([times, stage.drive(times), y])


def held_out(spec: Spec, stage: Stage, kind: str, noise: Noise, pairs: Pairs) -> Array:
    """Another drive of the same range from the same start, through the same truth."""
    rng = np.random.default_rng([spec.seed, 6])
    name = str(rng.choice(others(spec.drive)))
    start = float(stage.u[0])
    reach = float(np.max(np.abs(stage.u - start)))
    volts = (start if spec.drive in BOTTOM else start - reach, start + reach)
    drive = make_drive(name, spec.seed + 1, spec.rate, spec.samples // 2 + 1000, volts)
    other = Stage(
        stage.law, stage.params, stage.gain, stage.rated, drive, _before(kind, drive, stage.rated)
    )
    return _measured(other, other.recorded(pairs), noise, np.random.default_rng([spec.seed, 13]))


def truth(c: Chosen, oracle: Oracle, rivals: Rivals, wide: Array) -> dict:
    """The label of one effect: how visible it is, and what could pass for it."""
    noise = oracle.noise
    residual = noise.whiten(c.residual)
    mark, beyond = off(oracle.basis, residual), off(wide, residual)
    apart = rivals.separation(residual, oracle.basis, c.name)
    apart_beyond = rivals.separation(residual, wide, c.name)
    power, closest = float(mark @ mark), min(apart, key=apart.__getitem__)
    alike = look_alikes(apart)
    return {
        "name": c.name,
        "key": c.key,
        "kind": kind_of(c.name),
        "site": c.effect.site,
        "parameters": c.params,
        "amplitude": c.amplitude,
        "capped": c.amplitude >= c.effect.cap,
        "level": rms(c.residual) / noise.total,
        "power": power,
        "separable": power >= DETECTABLE and not alike,
        "look_alikes": alike,
        "nine_tenths": look_alikes(apart, ALIKE * power),
        "least_lambda": apart[closest],
        "closest": closest,
        "beyond_shape": {
            "level": float(np.sqrt(beyond @ beyond / len(beyond))),
            "look_alikes": look_alikes(apart_beyond),
        },
    }


def own_rate(stage: Stage, noise: Noise, seed: int) -> dict | None:
    """What a rate-dependent law shows beyond itself without the rate, and what passes for that.

    An effect passes for it that leaves a tenth of its power or λ under SEPARABLE.
    """
    if not stage.law.still:
        return None
    still = stage.with_params({**stage.params, **stage.law.still})
    oracle = Oracle(still, noise, held=stage.law.still)
    residual = noise.whiten(oracle.left(stage.recorded([])))
    mark = off(oracle.basis, residual)
    power = float(mark @ mark)
    apart = Rivals(still, noise, seed).separation(residual, oracle.basis, "")
    return {
        "level": float(np.sqrt(power / len(mark))),
        "power": power,
        "alike": look_alikes(apart, max(SEPARABLE, ALIKE * power)),
    }

"""One case of the exam: recording, held-out recording and label, from its specification."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path as File

import numpy as np

from .actuator import Actuator, draw_law, rms
from .drives import Array
from .oracle import expected_rmse
from .refit import Chord
from .separability import SEPARABLE, Off, separation
from .templates import floor_of, make_drive
from .truth import EFFECTS, OUTSIDE, Effect, name_of, noise, whiten

ALL = EFFECTS | OUTSIDE


@dataclass(frozen=True)
class Spec:
    """What a case is to be; `effects` are keys of the catalogue, `levels` their visible levels."""

    kind: str
    effects: tuple[str, ...]
    levels: tuple[float, ...]
    base: str
    drive: str
    rate: float
    samples: int
    noise: str
    noise_fraction: float
    seed: int
    holdout: str | None = None


@dataclass(frozen=True)
class Made:
    """A built case: columns s, V, um of the recording and, for some, of the held-out one."""

    recording: Array
    holdout: Array | None
    label: dict

    def write(self, folder: File, name: str) -> None:
        """Write name.csv, and name.holdout.csv."""
        for part, columns in (("", self.recording), (".holdout", self.holdout)):
            if columns is not None:
                header, fmt = "time_s,voltage_V,displacement_um", ("%.9g", "%.9g", "%.8g")
                file = folder / f"{name}{part}.csv"
                np.savetxt(file, columns, fmt, ",", header=header, comments="")


@dataclass(frozen=True)
class Scaled:
    """An effect at the amplitude that leaves its level after the refit."""

    key: str
    effect: Effect
    params: dict
    amplitude: float
    clean: Array
    shape: Array
    gains: Array
    left: Array


def scale(actuator: Actuator, key: str, level_um: float, rng: np.random.Generator) -> Scaled:
    """The effect at the amplitude whose response, refitted by the base, leaves `level_um` (rms)."""
    e, absorber = ALL[key], actuator.absorber
    shape = e.shape(rng)
    for _ in range(2):  # again from the better basin, if the thorough refit finds one
        a, left = _search(actuator, e, shape, level_um)
        params = e.parameters(a, shape, actuator.scene)
        clean = actuator.with_one(e, params)
        found = absorber.fit(clean, thorough=True)
        if rms(found[2]) > 0.94 * left or a >= e.cap:
            break
        absorber.shape = found[0]
    return Scaled(key, e, params, a, clean, *found)


def _search(actuator: Actuator, e: Effect, shape: dict, level_um: float) -> tuple[float, float]:
    """Amplitude and what its refit leaves: secants in the logarithms, kept within a bracket."""
    a, low, high, power = e.typical, 0.0, e.cap, 1.0
    tried: list[tuple[float, float]] = []
    for _ in range(9):
        clean = actuator.with_one(e, e.parameters(a, shape, actuator.scene))
        left = rms(actuator.absorber.fit(clean)[2])
        error = float(np.log(max(left, 1e-12) / level_um))
        tried.append((a, left))
        if abs(error) < 0.04 or (a >= e.cap and error < 0):
            break
        low, high = (a, high) if error < 0 else (low, a)
        if len(tried) > 1:
            (a0, left0), (a1, left1) = tried[-2:]
            slope = np.log(max(left1, 1e-12) / max(left0, 1e-12)) / np.log(a1 / a0)
            power = float(np.clip(slope, 0.4, 12.0))
        a *= float(np.exp(np.clip(-error / power, -4, 4)))
        if a >= high == e.cap:
            a = e.cap
        elif not low < a < high:
            a = 0.5 * (low + high)
    return min(tried, key=lambda x: abs(np.log(max(x[1], 1e-12) / level_um)))


def build(spec: Spec) -> Made:
    """Simulate a case: scale its effects, refit, compare with the catalogue, add noise."""
    drive = make_drive(spec.drive, spec.seed, spec.rate, spec.samples)
    law = draw_law(spec.base, drive, spec.seed)
    actuator = Actuator(spec.base, law, drive)
    sd = spec.noise_fraction * actuator.scene.stroke
    effects = [
        scale(actuator, key, level * sd, np.random.default_rng([spec.seed, 19, k]))
        for k, (key, level) in enumerate(zip(spec.effects, spec.levels, strict=True))
        if ALL[key].side != "Q"
    ]
    pairs = [(s.effect, s.params) for s in effects]
    both = len(effects) > 1
    clean = actuator.with_all(pairs) if both else effects[0].clean if effects else actuator.plain
    chord, left = _absorbed(actuator, effects, clean)
    e = noise(spec.noise, len(clean), sd, np.random.default_rng([spec.seed, 11]))
    y, coarse = _digitise(spec, clean + e, sd, actuator)
    truths = [_truth(s, actuator, chord, spec, sd) for s in effects]
    truths += [coarse] if coarse else []
    residual = rms(left + (y - clean - e))
    holdout, unforeseen, expected = _holdout(spec, actuator, pairs, coarse, sd)
    change = rms(clean - actuator.plain)
    spread = float(np.sum((y - y.mean()) ** 2))
    label = {
        "kind": spec.kind,
        "effects": truths,
        "level": residual / sd,
        "concealment": 1 - (rms(left) / change) ** 2 if change > 0 else 0.0,
        "R2": 1 - float(np.sum((left + y - clean) ** 2)) / spread,
        "base": spec.base,
        "base_parameters": law,
        "between_samples": {k: v / sd for k, v in actuator.between_samples(chord).items()},
        "noise": spec.noise,
        "noise_sd_um": sd,
        "stroke_um": actuator.scene.stroke,
        "floor": floor_of(drive),
        "rests_s": drive.rests,
        "period_s": drive.period,
        "oracle_rmse_um": unforeseen,
        "oracle_fit_rmse_um": expected,
        "samples": len(clean),
        "spec": asdict(spec),
    }
    columns = np.column_stack([drive.times, drive(drive.times), y])
    return Made(columns, holdout, label)


def _absorbed(actuator: Actuator, effects: list[Scaled], clean: Array) -> tuple[Chord, Array]:
    """The refit of the noise-free response: its tangent space, and what it leaves."""
    if len(effects) == 1:
        shape, gains, left = effects[0].shape, effects[0].gains, effects[0].left
    else:
        shape, gains, left = actuator.absorber.fit(clean, thorough=bool(effects))
    return Chord(actuator.absorber, shape, gains), left


def _digitise(spec: Spec, y: Array, sd: float, actuator: Actuator) -> tuple[Array, dict | None]:
    """The recorder's quantisation, after the noise, where the case has it."""
    if "quantisation" not in spec.effects:
        return y, None
    e = EFFECTS["quantisation"]
    level = spec.levels[spec.effects.index("quantisation")]
    a = level * sd * np.sqrt(12) / actuator.scene.stroke
    params = e.parameters(a, e.shape(np.random.default_rng([spec.seed, 23])), actuator.scene)
    coded = e.apply(y, **params)
    reached = rms(coded - y) / sd
    own = {"name": "quantisation", "key": "quantisation", "catalogued": True, "site": e.site}
    return coded, own | {
        "axes": e.axes, "spot": None, "parameters": params, "amplitude": a, "capped": False,
        "level_requested": level, "level": reached, "concealment": 0.0,
        "separable": True, "look_alikes": [], "least_lambda": None, "closest": None,
        "power": reached**2 * len(y),
    }  # fmt: skip


def _truth(s: Scaled, actuator: Actuator, chord: Chord, spec: Spec, sd: float) -> dict:
    """The label of one effect, with what could pass for it on this recording."""
    own = Chord(actuator.absorber, s.shape, s.gains) if len(spec.effects) > 1 else chord
    # a diagnosis starts from the refit: take out the tangent space there
    residual = Off(own, spec.noise, sd)(whiten(spec.noise, s.left, sd))
    name = name_of(s.key)
    apart = separation(residual, s.clean, actuator.bank(), own, spec.noise, sd, name, spec.seed)
    closest = min(apart, key=apart.__getitem__)
    change, power = rms(s.clean - actuator.plain), float(residual @ residual)
    return {
        "name": name,
        "key": s.key,
        "catalogued": s.key in EFFECTS,
        "site": s.effect.site,
        "axes": s.effect.axes,
        "spot": _spot(s, actuator),
        "parameters": s.params,
        "amplitude": s.amplitude,
        "capped": s.amplitude >= s.effect.cap,
        "level_requested": spec.levels[spec.effects.index(s.key)],
        "level": rms(s.left) / sd,
        "concealment": 1 - (rms(s.left) / change) ** 2,
        "separable": apart[closest] >= SEPARABLE,
        "look_alikes": sorted(k for k, v in apart.items() if v < SEPARABLE),
        "least_lambda": apart[closest],
        "closest": closest,
        "power": power,
    }


def _spot(s: Scaled, actuator: Actuator) -> dict | None:
    """A place that the effect must be found at, where the physics fixes one."""
    if s.key == "mains_interference":
        return {"axis": "frequency", "value": s.params["frequency"]}
    if s.key == "saturation":
        return {"axis": "level", "value": 0.5 * (s.params["u_max"] + actuator.scene.high)}
    return None


def _holdout(
    spec: Spec, actuator: Actuator, pairs: list, coarse: dict | None, sd: float
) -> tuple[Array | None, float | None, float | None]:
    """Another drive through the same truth, the rms of what nobody could predict in it, and what
    remains to one who knows all but the numbers."""
    if spec.holdout is None:
        return None, None, None
    drive = make_drive(spec.holdout, spec.seed + 1, spec.rate, spec.samples // 2 + 1000, spec.seed)
    held_out = Actuator(spec.base, actuator.law, drive)
    clean = held_out.with_all(pairs)
    e = noise(spec.noise, len(clean), sd, np.random.default_rng([spec.seed, 13]))
    y = clean + e
    if coarse:
        y = EFFECTS["quantisation"].apply(y, **coarse["parameters"])
    unforeseen = rms(y - clean)
    expected = expected_rmse(actuator, held_out, pairs, spec.noise, sd, unforeseen)
    return np.column_stack([drive.times, drive(drive.times), y]), unforeseen, expected

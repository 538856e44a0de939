"""One case: its recordings, and a label that says what is in them and what they can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..actuator import rms
from ..drives import Array
from ..inexact.case import opening_of
from ..inexact.stage import Pairs, Stage
from ..templates import floor_of
from ..truth import Effect, name_of
from .design import Spec
from .effects import FAMILIES, SHARES, TRIED, family_of
from .rivals import Rivals, look_alikes, unit
from .session import Session, draw_session, possible

LEVELS = (0.3, 30.0)  # noise floors
LARGEST = 0.06  # of the stroke, rms
BEYOND_HYSTERESIS = 0.75  # share of effects whose level is that after what the law could absorb
UNSEEN = 0.5  # share kept of effects that the drive does not show at their largest
HIDDEN = 0.25  # share of effects on ordinary drives that are looked for where none shows them
SHOWN = 5.0  # detectability
GIVEN = 0.25  # share of recordings with a specified noise, beside those that show none
TRIES = 40
Rng = np.random.Generator


@dataclass(frozen=True)
class Chosen:
    """An effect at its amplitude, what it changes, and what remains of that, in um."""

    key: str
    params: dict
    amplitude: float
    change: Array
    residual: Array

    @property
    def effect(self) -> Effect:
        return TRIED[self.key]

    @property
    def name(self) -> str:
        return name_of(self.key)


def scale(session: Session, key: str, shape: dict, wanted: float, beyond: bool) -> Chosen:
    """The effect at the amplitude whose change has the rms `wanted` in um, or at its cap.

    Beyond hysteresis it is what is left of the change, which itself is at most LARGEST.  Secants in
    the logarithms; a tenth off is near enough.
    """
    e, scene = TRIED[key], session.first.scene
    a, power, tries = e.typical, 1.0, []
    for _ in range(7):
        params = e.parameters(a, shape, scene)
        change = session.recorded([(e, params)]) - session.plain
        residual = session.law_free.residual(change)
        reached = max(rms(residual if beyond else change) / wanted, 1e-9)
        if beyond:
            reached = max(reached, rms(change) / (LARGEST * scene.stroke))
        error = float(np.log(reached))
        tries.append((abs(error), error, a, Chosen(key, params, a, change, residual)))
        if abs(error) < 0.1 or (a >= e.cap and error < 0):
            break
        if len(tries) > 1 and a != tries[-2][2]:
            bend = (error - tries[-2][1]) / np.log(a / tries[-2][2])
            power = float(np.clip(bend, 0.3, 8.0))
        a = min(e.cap, a * float(np.exp(np.clip(-error / power, -4, 4))))
        if a < 1e-6:
            break
    return min(tries, key=lambda x: x[0])[3]


def choose(session: Session, families: Sequence[str], rng: Rng) -> Chosen:
    """An effect of one of the families at a drawn level within LEVELS, evenly in the logarithm.

    Most levels are those after what hysteresis could absorb.  What this drive shows at no size is
    kept for some cases: there the right answer is that it cannot be shown.
    """
    shares = np.array([SHARES[family] for family in families])
    floor, hidden = session.noise.total, session.first.drive.name != "protocol"
    hidden = hidden and rng.uniform() < HIDDEN
    best, most = None, 0.0
    for turn in range(TRIES):
        key = str(rng.choice(FAMILIES[str(rng.choice(families, p=shares / shares.sum()))]))
        wanted = floor * float(np.exp(rng.uniform(*np.log(LEVELS))))
        beyond, keep = rng.uniform() < BEYOND_HYSTERESIS, rng.uniform() < UNSEEN
        shape = TRIED[key].shape(rng)
        if not possible(key, session.first):
            continue
        hidden = hidden and turn < TRIES // 2
        chosen = scale(session, key, shape, wanted, bool(beyond) and not hidden)
        level, raw = rms(chosen.residual) / floor, rms(chosen.change) / floor
        if level > 1.2 * LEVELS[1] or raw < LEVELS[0]:
            continue
        if level > most:
            best, most = chosen, level
        shown = float(np.linalg.norm(session.law_free.off(chosen.change[:, None]))) >= SHOWN
        if (hidden and not shown and raw > 1) or (not hidden and (level >= LEVELS[0] or keep)):
            return chosen
    if best is None:
        raise RuntimeError("no effect of these families changes anything on this drive")
    return best


def content(session: Session, spec: Spec) -> list[Chosen]:
    """The effects of a case: none, one, or two of two families."""
    rng = np.random.default_rng([spec.seed, 2])
    if spec.content == "none":
        return []
    one = choose(session, list(FAMILIES), rng)
    if spec.content == "one":
        return [one]
    own = family_of(one.key)
    return [one, choose(session, [family for family in FAMILIES if family != own], rng)]


def together(session: Session, chosen: Sequence[Chosen]) -> list[Chosen]:
    """Each effect with what it changes beside the other."""
    if len(chosen) < 2:
        return list(chosen)
    pairs: Pairs = [(c.effect, c.params) for c in chosen]
    both, out = session.recorded(pairs), []
    for c, alone in zip(chosen, reversed(pairs), strict=True):
        change = both - session.recorded([alone])
        out.append(replace(c, change=change, residual=session.law_free.residual(change)))
    return out


def build(spec: Spec) -> tuple[list[Array], dict]:
    """Simulate a case: columns s, V, um of each recording, and the label."""
    session, kind = draw_session(spec)
    noise = session.noise
    effects = together(session, content(session, spec))
    clean = session.recorded([(c.effect, c.params) for c in effects])
    rivals = Rivals(session, spec.seed) if effects or session.memory == "degrading" else None
    floors = [floor_of(stage.drive) for stage in session.stages]
    given = "none" in floors or np.random.default_rng([spec.seed, 5]).uniform() < GIVEN
    residual = session.any_law.off(session.plain[:, None])
    label = {
        "case": f"{spec.number:03d}",
        "half": spec.half,
        "base": spec.law,
        "memory": session.memory,
        "base_parameters": dict(session.first.params),
        "believed": spec.believed,
        "files": ["recording.csv", "second.csv"][: len(session.stages)],
        "drive": spec.drive,
        "second_drive": spec.second,
        "history": kind,
        "rate_Hz": spec.rate,
        "samples": len(clean),
        "rated_V": list(session.first.rated),
        "stroke_um": session.first.scene.stroke,
        "opening": opening_of(session.first),
        "noise": {"colour": noise.colour, "order": noise.order, "sensor_um": session.sensor.total,
                  "drive_V": session.drive_noise, "total_um": noise.total, "given": bool(given)},
        "floor": floors[0],
        "law_left": rms(residual),
        "effects": [
            truth(c, session, rivals, [o for o in effects if o is not c]) for c in effects
        ],
        "own_path": own_path(session, rivals),
    }  # fmt: skip
    ends = np.cumsum([0, *(len(s.drive.times) for s in session.stages)])
    recordings = [
        measured(session, stage, clean[a:b], np.random.default_rng([spec.seed, 11 + k]))
        for k, (stage, a, b) in enumerate(zip(session.stages, ends, ends[1:], strict=False))
    ]
    return recordings, label


def measured(session: Session, stage: Stage, clean: Array, rng: Rng) -> Array:
    """Columns s, V, um of a recording with its noise."""
    times, sensor = stage.drive.times, session.sensor
    y = sensor.recorded(clean + sensor.sample(len(clean), rng))
    volts = stage.drive(times) + session.drive_noise * rng.standard_normal(len(times))
    return np.column_stack([times, volts, y])


def truth(c: Chosen, session: Session, rivals: Rivals, beside: list[Chosen]) -> dict:
    """The label of one effect: its size, and what the recordings show of it."""
    floor = session.noise.total
    aside = beside[0].change if beside else None
    out = {
        "name": c.name,
        "key": c.key,
        "family": family_of(c.key),
        "site": c.effect.site,
        "parameters": c.params,
        "amplitude": c.amplitude,
        "capped": c.amplitude >= c.effect.cap,
        "size_um": float(np.ptp(c.change)),
        "raw_level": rms(c.change) / floor,
        "level": rms(c.residual) / floor,
    }
    for which, oracle in (("", session.law_free), ("_any", session.any_law)):
        mark = oracle.off(c.change[:, None])
        out[f"alone{which}"] = float(np.linalg.norm(mark))
        if aside is not None:
            other = unit(oracle.off(aside[:, None]))
            mark = mark - other @ (other.T @ mark)
        out[f"detectability{which}"] = float(np.linalg.norm(mark))
        apart = rivals.apart(c.change, c.name, oracle, aside)
        out[f"accepted{which}"] = [c.name, *look_alikes(apart, float(np.sum(mark**2)))]
        closest = min(apart, key=apart.__getitem__)
        out[f"closest{which}"], out[f"least_lambda{which}"] = closest, apart[closest]
    return out


def own_path(session: Session, rivals: Rivals | None) -> dict | None:
    """What a degrading law shows of its degradation, and what passes for that."""
    if session.memory != "degrading" or rivals is None:
        return None
    fresh = replace(session, stages=tuple(
        s.with_params({**s.params, "worn": 0.0}) for s in session.stages
    ), memory="returning")  # fmt: skip
    change = session.plain - fresh.plain
    oracle = fresh.knowing(["fading"], False)
    apart = rivals.apart(change, "", oracle, None)
    mark = oracle.off(change[:, None])
    return {
        "detectability": float(np.linalg.norm(mark)),
        "size_um": float(np.ptp(change)),
        "alike": look_alikes(apart, float(np.sum(mark**2))),
    }


def write(folder: Path, recordings: Sequence[Array], label: dict) -> None:
    """Write a case's recordings into its folder."""
    folder = folder / label["case"]
    folder.mkdir(parents=True, exist_ok=True)
    for name, columns in zip(label["files"], recordings, strict=True):
        header, fmt = "time_s,voltage_V,displacement_um", ("%.9g", "%.9g", "%.8g")
        np.savetxt(folder / name, columns, fmt, ",", header=header, comments="")

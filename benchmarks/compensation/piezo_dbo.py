"""A real actuator: our drive beside the one its authors sent, on paper.

    python -m benchmarks.compensation.piezo_dbo --data DIR

DIR holds piezo_dbo (see FRACJAX_DATA in CONTRIBUTING.md).  Its first file identifies a model; its
second holds a desired displacement, the voltage that the authors' inverse model made of it, and
what the sensor read.  Nothing can be driven here.  What can be told: how well the model predicts
the sensor under the authors' voltage, and whether our voltage differs from theirs in the sense
that their measured error calls for.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

import fracjax as fj

STEP = 5e-3  # s
BEGIN = 5300  # where the authors' inverse begins
SAMPLES = slice(7000, 8600)  # the authors' inverse at work, amplitudes changing
MODELS = ("lfdh", "foh", "foh + minor_loop_memory", "prandtl_ishlinskii")
STREAMED = ("prandtl_ishlinskii",)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=os.environ.get("FRACJAX_DATA"))
    folder = parser.parse_args().data
    if folder is None or not (Path(folder) / "piezo_dbo").is_dir():
        raise SystemExit("Give --data DIR, a folder that holds piezo_dbo.")
    first, second = (
        np.loadtxt(Path(folder) / "piezo_dbo" / name)
        for name in ("Model_Vi_Do.dat", "Test_Vi_Do_Di.dat")
    )
    recording = fj.Recording(first[:2000, 0], first[:2000, 4], STEP, source="Model_Vi_Do.dat")
    applied, read, desired = (second[SAMPLES, column] for column in (0, 4, 8))
    desired = desired + (read - desired).mean()
    stroke = np.ptp(desired)
    theirs = read - desired
    print(f"authors' drive, measured: {percent(theirs, stroke)} rms of {stroke:.1f} um")
    for name in MODELS:
        model, offset = report(name, recording, applied, read, desired)
        if name in STREAMED:
            in_real_time(model, offset, second, (0.05, 4.0))
    print(
        "Not to be concluded: what error our drive would leave.  The predicted error is the "
        "model's own, and large only where the motion starts amid its swing; what the model does "
        "not predict of the sensor under the authors' drive would come on top."
    )


def in_real_time(
    model: fj.Model, offset: float, second: np.ndarray, band: tuple[float, float]
) -> None:
    """The streaming inverse beside the authors' drive, from where theirs begins."""
    applied, read, desired = (second[BEGIN : SAMPLES.stop, column] for column in (0, 4, 8))
    last = slice(SAMPLES.start - BEGIN, None)
    low, high = applied.min() - 0.5, applied.max() + 0.5
    options = {"limits": (low, high), "offset": offset}
    whole = fj.streaming_inverse(model, STEP, band, **options)
    slope = np.ptp(read) / np.ptp(applied)
    line = fj.streaming_inverse(
        fj.Model(fj.blocks.QuasiStaticForce(slope), "linear part"), STEP, band, limits=(-99, 99)
    )
    span = np.ptp(applied[last])
    aim = desired + (read - desired)[last].mean()
    for motion, wanted in {"desired": aim, "measured": read}.items():
        for name, inverse in {"streaming inverse": whole, "linear part": line}.items():
            drive = inverse.run(wanted).output[last]
            drive = drive - (drive - applied[last]).mean()
            print(
                f"  {name} of the {motion} motion: {percent(drive - applied[last], span)} rms "
                "from the drive that the authors sent"
            )
    observer = fj.streaming_model(model, STEP, band, **options)
    given = observer.run(applied).output[last]
    error = read[last] - given
    mine = observer.run(whole.run(aim).output).output[last]
    stroke = np.ptp(aim[last])
    inside = np.mean(np.abs(error - error.mean()) < 1.96 * error.std())
    print(
        f"  the displacement it would have given: within {percent(mine - aim[last], stroke)} rms "
        "of the desired one by the model, "
        f"± {100 * 1.96 * error.std() / stroke:.2f} % of the stroke, "
        f"which holds {100 * inside:.0f} % of what the sensor read under the authors' drive"
    )


def percent(error: np.ndarray, stroke: float) -> str:
    return f"{100 * np.std(error) / stroke:.2f} %"


def report(
    name: str,
    recording: fj.Recording,
    applied: np.ndarray,
    read: np.ndarray,
    desired: np.ndarray,
) -> tuple[fj.Model, float]:
    """One model: its prediction of their run, its drive, and the sense of the difference."""
    from fracjax._prepare._setting import setting_of

    stroke = np.ptp(desired)
    fit = fj.fit(fj.parse_model(name, setting_of([recording])), recording, history="constant")
    predicted = fj.simulate(fit.model, applied, STEP).response
    predicted = predicted + (read - predicted).mean()
    wanted = fj.Trajectory(desired, STEP, source="Test_Vi_Do_Di.dat")
    # The model's zero is set so that the authors' mean drive answers to the mean motion.
    static = fj.simulate(fit.model, applied, STEP).response
    found = fj.compensate(fit.model, wanted, offset=float((read - static).mean()))
    change = found.drive - applied
    slope = np.ptp(read) / np.ptp(applied)
    # Where their sensor read too much, a better drive is lower.
    sense = np.corrcoef(change, desired - read)[0, 1]
    print(
        f"{name}: rmse {fit.scores.rmse:.3f} um on the first file; under the authors' drive it "
        f"predicts the sensor to {percent(read - predicted, stroke)} rms; its own drive differs by "
        f"{percent(slope * change, stroke)} rms of the stroke, correlation with the correction "
        f"that their error calls for {sense:+.2f}; it is {found.drive.min():.2f} to "
        f"{found.drive.max():.2f} V (theirs {applied.min():.2f} to {applied.max():.2f} V), "
        f"predicted error {percent(found.error, stroke)} rms, {100 * found.max_error / stroke:.2g} "
        f"% at most ({found.method})"
    )
    return fit.model, float((read - static).mean())


if __name__ == "__main__":
    main()

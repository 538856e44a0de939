"""Does a change of the code's structure leave its results alone?

    FRACJAX_DATA=DIR python -m benchmarks.unchanged --to before      # on the code before
    FRACJAX_DATA=DIR python -m benchmarks.unchanged --to after       # on the code after
    python -m benchmarks.unchanged --compare before after

Stored are fit.json and diagnosis.json of the demonstration's recording, of ten cases of the exam
over all its base models, of piezo_dbo's steady cycles and of one damper loop; the table of a batch
of 20; and the draws of one posterior with a fixed seed.  What is there already is not made again.
The comparison lists every place where two results differ: verdicts, names and other words must be
equal, but for sentences, which may be written anew, and numbers to 1e-9 of the larger one, where
the larger is above 1e-12.  Its exit status is 1 where anything differs.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import fracjax as fj
from benchmarks.concealed.design import design
from benchmarks.concealed.exam import SEED, write_exam

RELATIVE, ZERO = 1e-9, 1e-12
CASES, SHORT = 10, 3000  # samples
SENTENCES = {"sentence", "summary", "reason", "warnings", "text", "checks"}
"""What may be said otherwise by code that finds the same."""
ELSEWHERE = {"seconds", "version", "recordings", "source"}
"""What belongs to a run, not to its result."""


def results(folder: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Every result's name and how it is made, as plain data."""
    from benchmarks.real.mr_damper import moving
    from benchmarks.real.recordings import mr_damper, piezo_dbo
    from fracjax._demo import __file__ as demo

    shipped = Path(demo).parent
    training = next(p for p in sorted(shipped.glob("*.csv")) if "held" not in p.name)
    recordings = {"demo": ("foh", lambda: fj.read(training))}
    chosen: list[int] = []
    specs = design(SEED)
    for base in sorted({spec.base for spec in specs}):
        of_base = [k for k, s in enumerate(specs) if s.base == base and s.samples <= SHORT]
        chosen += of_base[: math.ceil(CASES / len({s.base for s in specs}))]
    exam = folder / "exam"
    if not (exam / "labels.json").exists():
        write_exam(exam, [(k, specs[k]) for k in chosen[:CASES]])
    for k in chosen[:CASES]:
        case = exam / f"case_{k + 1:04d}.csv"
        recordings[case.stem] = specs[k].base, lambda case=case: fj.read(case)
    recordings["piezo_dbo"] = "foh", lambda: piezo_dbo()[0]
    recordings["mr_damper"] = "bouc_wen", lambda: moving(mr_damper("ensaio4.2"))
    for name, (model, read) in recordings.items():
        yield f"{name}.fit", lambda m=model, r=read: fj.fit(m, r()).to_dict()
        yield f"{name}.diagnosis", lambda m=model, r=read: fj.diagnose(m, r()).to_dict()
    yield "batch", batch
    yield "posterior", lambda: posterior(fj.read(training))


def batch() -> Any:
    """The table of 20 recordings of the model that they are fitted with."""
    generator = np.random.default_rng(7)
    time = np.arange(1000) / 500
    with TemporaryDirectory() as folder:
        for k in range(20):
            drive = 50 + 40 * np.sin(2 * np.pi * (1 + 0.1 * k) * time + 0.3 * k)
            block = fj.blocks.FOH(alpha=0.05 + 0.01 * k)
            response = np.asarray(fj.simulate(fj.Model(block), drive, 1 / 500).response)
            response = response + np.ptp(response) * 1e-3 * generator.standard_normal(time.size)
            table = np.column_stack([time, drive, response])
            header = "time_s,voltage_V,displacement_um"
            np.savetxt(f"{folder}/{k:02d}.csv", table, "%.9g", ",", header=header, comments="")
        table = fj.fit_batch("foh", sorted(Path(folder).glob("*.csv")), out=f"{folder}/out")
    values = table[[c for c in table if c == "status" or "." in c]]
    return json.loads(values.to_json(orient="records", double_precision=15))


def posterior(recording: fj.Recording) -> Any:
    """What is said of the parameters after 1,000 steps."""
    return fj.sample_posterior(fj.fit("foh", recording), seed=3, steps=1000).to_dict()


def store(folder: Path) -> None:
    """Make what is not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in results(folder):
        path = folder / f"{name}.json"
        if not path.exists():
            path.write_text(json.dumps(make(), indent=1) + "\n", encoding="utf-8")
            print(name, flush=True)


def differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Every place where two results differ, in words."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted({*one, *other}):
            if key in SENTENCES or key in ELSEWHERE:
                continue
            if key not in one or key not in other:
                yield f"{where}.{key}: only {'before' if key in one else 'after'}"
            else:
                yield from differences(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list):
        if len(one) != len(other):
            yield f"{where}: {len(one)} entries before, {len(other)} after"
        for k, (a, b) in enumerate(zip(one, other, strict=False)):
            yield from differences(a, b, f"{where}[{k}]")
    elif isinstance(one, float) and isinstance(other, float | int):
        size = max(abs(one), abs(other))
        if size > ZERO and abs(one - other) > RELATIVE * size:
            yield f"{where}: {one!r} before, {other!r} after, {abs(one - other) / size:.1e}"
    elif one != other:
        yield f"{where}: {one!r} before, {other!r} after"


def compare(before: Path, after: Path) -> int:
    """Print every difference; how many there are."""
    count = 0
    for path in sorted(before.glob("*.json")):
        found = list(
            differences(*(json.loads((p / path.name).read_text()) for p in (before, after)))
        )
        print(f"{path.stem}: {'equal' if not found else f'{len(found)} differences'}")
        for line in found:
            print(f"  {line}")
        count += len(found)
    return count


def main() -> None:
    """Command line: store, or compare."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--to", type=Path)
    parser.add_argument("--compare", type=Path, nargs=2)
    given = parser.parse_args()
    if given.compare:
        raise SystemExit(int(compare(*given.compare) > 0))
    store(given.to)


if __name__ == "__main__":
    main()

"""The README's picture: what the demonstration's model leaves over, before and after its diagnosis.

Run: python docs/picture.py
"""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import fracjax as fj
from fracjax._report._figures import residuals

PICTURE = Path(__file__).with_name("diagnosis.svg")


def main() -> None:
    """Diagnose what `fracjax demo` does, and draw it as its report does."""
    with as_file(files("fracjax") / "_demo") as shipped:
        training, held_out = (fj.read(shipped / f"{name}.csv") for name in ("training", "heldout"))
    diagnosis = fj.diagnose(fj.parse_model("foh"), training, holdout=held_out)
    fits = [diagnosis.base] + ([diagnosis.extended] if diagnosis.extended else [])
    # A white ground, for pages that are dark.
    drawing = str(residuals(fits, 0, diagnosis.noise))
    drawing = drawing.replace("<svg ", '<svg style="background: white" ', 1)
    PICTURE.write_text(drawing + "\n", encoding="utf-8")
    print(diagnosis.sentence)


if __name__ == "__main__":
    main()

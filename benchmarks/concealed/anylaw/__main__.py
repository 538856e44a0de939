"""Command line of the third tier.

python -m benchmarks.concealed.anylaw build --half development --out DIR
python -m benchmarks.concealed.anylaw build --half sealed --seed NUMBER --out DIR --labels ELSEWHERE
python -m benchmarks.concealed.anylaw answer --exam DIR --answers OUT [--cases 0:20] [--jobs 2]
python -m benchmarks.concealed.anylaw grade --answers OUT --labels DIR --to TABLES
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ..exam import part_of


def main() -> None:
    """Build a half, answer it, or grade the answers."""
    p = argparse.ArgumentParser(prog="benchmarks.concealed.anylaw", description=main.__doc__)
    commands = p.add_subparsers(dest="command", required=True)
    build = commands.add_parser("build", help="write recordings and labels")
    build.add_argument("--half", required=True, help="development or sealed")
    build.add_argument("--out", type=Path, required=True, help="folder for the recordings")
    build.add_argument("--labels", type=Path, help="folder for the labels, if another")
    build.add_argument("--seed", type=int, help="of the sealed half, or another development half")
    answer = commands.add_parser("answer", help="diagnose the cases with fracjax")
    answer.add_argument("--exam", type=Path, required=True, help="folder with cases.json")
    for command in (build, answer):
        command.add_argument("--jobs", type=int, default=1)
    grade = commands.add_parser("grade", help="mark the answers")
    for command in (answer, grade):
        command.add_argument("--answers", type=Path, required=True, help="of 001/diagnosis.json")
    grade.add_argument("--labels", type=Path, required=True, help="folder with labels.json")
    grade.add_argument("--to", type=Path, required=True, help="folder for the tables")
    for command in (build, answer, grade):
        command.add_argument("--cases", type=part_of, default=":", help="a part, such as 0:60")
    a = p.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # for workers: their products are small
    if a.command == "build":
        from .exam import build_half

        if a.half == "sealed" and a.labels is None:
            p.error("the sealed half's labels go elsewhere: --labels FOLDER")
        build_half(a.half, a.out, a.labels or a.out, a.seed, a.cases, a.jobs)
    elif a.command == "answer":
        from .answer import answer_all

        answer_all(a.exam, a.answers, a.cases, a.jobs)
    else:
        from .grade import grade_all

        grade_all(a.labels, a.answers, a.to, a.cases)


if __name__ == "__main__":
    main()

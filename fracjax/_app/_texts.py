"""What was chosen on the page as a command line and as Python, and refusals in the page's words."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from ._workspace import Workspace


def command_line(workspace: Workspace, task: str) -> str:
    """The call of `fracjax fit` or `fracjax diagnose` that does the same."""
    words = ["fracjax", task, *workspace.with_role("train"), "--model", workspace.model]
    for name in workspace.with_role("held out"):
        words += ["--holdout", name]
    if task == "diagnose":
        for name in workspace.with_role("repeat"):
            words += ["--repeat", name]
        if workspace.noise:
            words += ["--noise", workspace.noise]
    for option, value in workspace.options.items():
        words += [f"--{option.replace('_', '-')}", str(value)]
    for start, stop in workspace.mask:
        words += ["--mask", f"{start:.6g} s..{stop:.6g} s"]
    return shlex.join([*words, "--out", "results"])


def python_code(workspace: Workspace, task: str) -> str:
    """The same in Python."""
    options = "".join(f", {name}={value!r}" for name, value in workspace.options.items())

    def read(role: str) -> str:
        calls = [f"fj.read({name!r}{options})" for name in workspace.with_role(role)]
        return calls[0] if len(calls) == 1 else f"[{', '.join(calls)}]"

    lines = ["import fracjax as fj", "", f"recordings = {read('train')}"]
    keywords = ""
    if workspace.mask:
        keywords += f", mask={[(float(f'{a:.6g}'), float(f'{b:.6g}')) for a, b in workspace.mask]}"
    if task == "diagnose":
        if workspace.with_role("held out"):
            keywords += f", holdout={read('held out')}"
        if workspace.with_role("repeat"):
            keywords += f", repeat={read('repeat')}"
        if workspace.noise:
            keywords += f", noise={workspace.noise!r}"
    call, model = f"fj.{task}", f"{workspace.model!r}"
    if task == "fit" and workspace.with_role("held out"):
        call, model = "fj.compare", f"[{workspace.model!r}]"
        keywords += f", holdout={read('held out')}"
    lines += [
        f"result = {call}({model}, recordings{keywords})",
        'fj.write_report(result, "report.html")',
    ]
    return "\n".join(lines)


_FIELDS = {
    "--input": "the drive column",
    "--output": "the response column",
    "--time": "the time column",
    "--unit drive=": "the drive unit",
    "--unit response=": "the response unit",
    "--clock": "the time unit",
    "--rate": "the sampling rate",
    "--noise": "the sensor noise",
}
"""What an option of the command line is called on the page."""


def on_the_page(refusal: str, folder: Path) -> str:
    """A refusal in the page's words: files by their names, and its fields instead of options."""
    text = refusal.rstrip(".").replace(f"{folder}/", "")
    for option, field in _FIELDS.items():
        text = re.sub(rf"{option}\s?(?=[^\s,;])", f"{field} ", text)
    return re.sub(r"give (?=the )", "choose ", text) + "."

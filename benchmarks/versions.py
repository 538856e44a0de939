"""What a table of measurements was made with, and on."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def versions(packages: Sequence[str]) -> str:
    """A comment line for a CSV file: Python's version, that of each package, and the machine."""
    found = []
    for name in packages:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} not installed")
    return f"# Python {platform.python_version()}; {', '.join(found)}; {_machine()}\n"


def _machine() -> str:
    facts = Path("/proc/cpuinfo")
    named = facts.read_text(encoding="utf-8").splitlines() if facts.exists() else []
    models = [line.partition(":")[2].strip() for line in named if line.startswith("model name")]
    told = models[0] if models else platform.processor()
    return f"{os.cpu_count()} cores of {told}, {platform.system()} {platform.machine()}"

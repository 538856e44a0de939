"""What a table of measurements was made with."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version


def versions(packages: Sequence[str]) -> str:
    """A comment line for a CSV file: Python's version and that of each package."""
    found = []
    for name in packages:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} not installed")
    return f"# Python {platform.python_version()}; {', '.join(found)}\n"

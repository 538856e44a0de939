"""All tables of real recordings, or those that are named, are made again.

    python -m benchmarks.real [NAME …]

`others` and `peers` are left out unless they are named: the first needs recordings that are fetched
by hand, the second an environment of its own.
"""

from __future__ import annotations

import subprocess
import sys

TABLES = ("piezo_dbo", "fsm_cubespec", "mr_damper", "nulls", "semi_synthetic", "machines")


def main() -> int:
    """Run one table after the other; 1 where one of them failed."""
    names = sys.argv[1:] or TABLES
    codes = [
        subprocess.run([sys.executable, "-m", f"benchmarks.real.{name}"], check=False).returncode
        for name in names
    ]
    for name, code in zip(names, codes, strict=True):
        print(name, "made again" if code == 0 else f"failed with status {code}")
    return int(any(codes))


if __name__ == "__main__":
    sys.exit(main())

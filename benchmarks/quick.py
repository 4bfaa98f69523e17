"""The benchmarks that need no data and take a minute, one after the other: what ``make bench`` runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

QUICK = (
    ("start_up.py",),
    ("kinematics.py", "--poses", "2000"),
    ("rendering.py", "--repeats", "5"),
    ("simulator.py", "--plants", "3"),
)


def main() -> int:
    folder = Path(__file__).resolve().parent
    failed = []
    for script, *options in QUICK:
        print(f"\n== benchmarks/{' '.join((script, *options))}\n", flush=True)
        if subprocess.run([sys.executable, str(folder / script), *options], check=False).returncode:
            failed.append(script)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

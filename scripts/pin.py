"""Write constraints.txt: the versions of all that ``punnet[dev]`` installs, as pip resolves it today."""

import json
import subprocess
import sys
from pathlib import Path

HEADER = """\
# Exact versions of everything that `pip install -e .[dev]` brings, Python 3.11 to 3.13. The Makefile passes
# this file to pip with -c; users of the published package are free. Written by `make pin`, not by hand.
"""


def main() -> None:
    """Resolve without the present pins, and write what came out, sorted."""
    root = Path(__file__).resolve().parent.parent
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--dry-run",
        "--ignore-installed",
        "--report",
        "-",
    ]
    report = json.loads(subprocess.run([*command, f"{root}[dev]"], check=True, stdout=subprocess.PIPE).stdout)
    pins = {
        package["metadata"]["name"].lower().replace("_", "-"): package["metadata"]["version"]
        for package in report["install"]
    }
    del pins["punnet"]
    lines = [f"{name}=={version}\n" for name, version in sorted(pins.items())]
    (root / "constraints.txt").write_text(HEADER + "".join(lines))
    print(f"constraints.txt: {len(lines)} packages")


if __name__ == "__main__":
    main()

"""Write constraints.txt: the versions of all that ``punnet[dev]`` installs, as pip resolves it today.

Resolved for the oldest Python that is supported, down to the patch release (Debian 12 has 3.11.2): some
packages ask for more than that in their newest version.
"""

import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

OLDEST_PYTHON = "3.11.0"
HEADER = """\
# Exact versions of everything that `pip install -e .[dev]` brings, Python 3.11 to 3.13. The Makefile passes
# this file to pip with -c; users of the published package are free. Written by `make pin`, not by hand.
"""


def main() -> None:
    """Resolve without the present pins, and write what came out, sorted."""
    root = Path(__file__).resolve().parent.parent
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    # The developers' extra names the others that it holds as punnet[...]; their packages are what is resolved.
    wanted = list(project["dependencies"])
    for extra in ("train", "ros", "lerobot", "arms", "dev"):
        wanted += extras[extra]
    wanted = [requirement for requirement in wanted if not requirement.startswith("punnet[")]
    with tempfile.TemporaryDirectory() as nowhere:
        options = ["--quiet", "--dry-run", "--ignore-installed", "--report", "-", "--target", nowhere]
        options += ["--python-version", OLDEST_PYTHON, "--only-binary", ":all:"]
        command = [sys.executable, "-m", "pip", "install", *options, *wanted]
        report = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    pins = {
        package["metadata"]["name"].lower().replace("_", "-"): package["metadata"]["version"]
        for package in report["install"]
    }
    lines = [f"{name}=={version}\n" for name, version in sorted(pins.items())]
    (root / "constraints.txt").write_text(HEADER + "".join(lines))
    print(f"constraints.txt: {len(lines)} packages")


if __name__ == "__main__":
    main()

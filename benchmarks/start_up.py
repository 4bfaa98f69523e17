"""How long the package and the command take to start: the shortest of several fresh processes, milliseconds.

python benchmarks/start_up.py [--repeats 7] [--json]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time

CASES = {
    "python, nothing else": ("-c", "pass"),
    "import numpy": ("-c", "import numpy"),
    "import punnet": ("-c", "import punnet"),
    "import punnet.scene": ("-c", "import punnet.scene"),
    "import punnet.perception": ("-c", "import punnet.perception"),
    "import punnet.planning": ("-c", "import punnet.planning"),
    "punnet --help": ("-m", "punnet", "--help"),
    "punnet models": ("-m", "punnet", "models"),
}


def fastest(arguments: tuple[str, ...], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - begin)
    return 1e3 * min(times)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    options = parser.parse_args()
    results = {name: round(fastest(arguments, options.repeats), 1) for name, arguments in CASES.items()}
    if options.json:
        print(json.dumps(results, indent=2))
        return
    for name, milliseconds in results.items():
        print(f"{name:<28}{milliseconds:8.0f} ms")


if __name__ == "__main__":
    main()

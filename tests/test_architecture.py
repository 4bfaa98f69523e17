"""The house rules of docs/architecture.md, checked on the source itself."""

from __future__ import annotations

import ast
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import punnet

SOURCE = Path(punnet.__file__).resolve().parent
ROOMS = (
    "geometry",
    "scene",
    "bundle",
    "data",
    "perception",
    "weight",
    "movement",
    "robot",
    "planning",
    "sim",
    "harvest",
    "train",
    "studio",
    "cli",
)
# Below every room: errors and where results are written.
FOUNDATIONS = {"errors", "outputs"}
LIGHT_ROOMS = ROOMS[: ROOMS.index("sim")]
HEAVY = {"mujoco", "matplotlib", "torch", "torchvision", "lightning"}
MOST_LINES = 400

FILES = sorted(SOURCE.rglob("*.py"))


def name_of(path: Path) -> str:
    return path.relative_to(SOURCE).as_posix()


def room_of(path: Path) -> str:
    """The room, or the module's own name at the top."""
    parts = path.relative_to(SOURCE).parts
    return parts[0] if len(parts) > 1 else path.stem


def imported(tree: ast.AST, *, anywhere: bool) -> Iterator[tuple[int, str]]:
    """Line and full name of what is imported; of the module's top level only, unless ``anywhere``.

    What stands under ``if TYPE_CHECKING`` is not imported at run time and does not count.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import; write the full name"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        elif anywhere or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from imported(node, anywhere=anywhere)


@pytest.fixture(scope="module")
def trees() -> dict[Path, ast.Module]:
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in FILES}


def test_every_folder_is_a_room_of_the_house() -> None:
    folders = {room_of(path) for path in FILES if path.parent != SOURCE}
    assert folders <= set(ROOMS)


def test_rooms_import_upward_only(trees: dict[Path, ast.Module]) -> None:
    offences = []
    for path, tree in trees.items():
        room = room_of(path)
        if room in ("__init__", "__main__"):
            continue
        allowed = {*FOUNDATIONS, *(ROOMS[: ROOMS.index(room) + 1] if room in ROOMS else ()), "__version__"}
        for line, module in imported(tree, anywhere=True):
            parts = module.split(".")
            if parts[0] == "punnet" and len(parts) > 1 and parts[1] not in allowed:
                offences.append(f"{name_of(path)}:{line} imports {module}")
    assert not offences, "\n".join(offences)


def test_light_rooms_import_nothing_heavy(trees: dict[Path, ast.Module]) -> None:
    offences = [
        f"{name_of(path)}:{line} imports {module}"
        for path, tree in trees.items()
        if room_of(path) in {*LIGHT_ROOMS, *FOUNDATIONS, "__init__", "__main__", "cli"}
        for line, module in imported(tree, anywhere=False)
        if module.split(".")[0] in HEAVY
    ]
    assert not offences, "\n".join(offences)


@pytest.mark.parametrize("room", ["punnet", *(f"punnet.{room}" for room in LIGHT_ROOMS), "punnet.cli"])
def test_importing_loads_nothing_heavy(room: str) -> None:
    program = f"import sys, {room}; print(*sorted({HEAVY!r} & set(sys.modules)))"
    loaded = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert loaded.stdout.split() == []


def test_import_is_quick() -> None:
    def fastest(program: str) -> float:
        times = []
        for _ in range(5):
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", program], check=True)
            times.append(time.perf_counter() - begin)
        return min(times)

    # 0.3 s on a quiet machine; here as a multiple of what an empty interpreter takes, whatever else runs.
    assert fastest("import punnet") < max(0.3, 8 * fastest("pass"))


def test_files_are_short() -> None:
    lengths = {name_of(path): len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    assert not {name: lines for name, lines in lengths.items() if lines > MOST_LINES}


def test_nothing_is_called_utils() -> None:
    vague = {"utils", "util", "helpers", "misc", "common"}
    assert not [name_of(path) for path in FILES if vague & set(path.with_suffix("").parts[-2:])]


def test_public_modules_say_what_they_offer(trees: dict[Path, ast.Module]) -> None:
    offences = []
    for path, tree in trees.items():
        if path.stem.startswith("_") and path.stem not in ("__init__", "__main__"):
            continue
        names = next(
            (
                ast.literal_eval(node.value)
                for node in tree.body
                if isinstance(node, ast.Assign | ast.AnnAssign)
                and node.value is not None
                and "__all__" in ast.unparse(node).split("=")[0]
            ),
            None,
        )
        if names is None:
            offences.append(f"{name_of(path)} has no __all__")
        elif missing := set(names) - defined(tree):
            offences.append(f"{name_of(path)}: __all__ names {sorted(missing)}, which it does not define")
        if ast.get_docstring(tree) is None:
            offences.append(f"{name_of(path)} has no docstring")
    assert not offences, "\n".join(offences)


def defined(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def test_nothing_is_pickled(trees: dict[Path, ast.Module]) -> None:
    forbidden = {"pickle", "dill", "shelve", "marshal", "joblib.dump", "joblib.load"}
    offences = [
        f"{name_of(path)}:{line} imports {module}"
        for path, tree in trees.items()
        for line, module in imported(tree, anywhere=True)
        if module in forbidden or module.split(".")[0] in forbidden
    ]
    assert not offences, "\n".join(offences)

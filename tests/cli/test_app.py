"""The command as a whole: help, errors in one line, exit codes, start-up time."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from typing import Any

import pytest
import typer

from punnet import __version__
from punnet.cli.app import app
from punnet.errors import PunnetError
from punnet.outputs import Interrupted
from tests.commands import require_understood


def leaves(group: typer.Typer, prefix: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = [(*prefix, command.name or command.callback.__name__) for command in group.registered_commands]
    for inner in group.registered_groups:
        found += leaves(inner.typer_instance, (*prefix, str(inner.name)))
    return found


COMMANDS = leaves(app)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_has_help_with_an_example(punnet, command: tuple[str, ...]) -> None:
    result = punnet(*command, "--help")
    assert result.code == 0
    text = " ".join(result.out.split())
    assert f"Example: punnet {' '.join(command)}" in text


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_example_is_understood(command: tuple[str, ...]) -> None:
    leaf: Any = typer.main.get_command(app)
    for name in command:
        leaf = leaf.commands[name]
    require_understood(leaf.epilog.removeprefix("Example: "))


def test_the_commands_of_the_readme_are_there(punnet) -> None:
    names = {" ".join(command) for command in COMMANDS}
    assert {"info", "models", "detect", "weigh", "plan", "demo", "harvest", "benchmark harvest"} <= names
    listing = punnet("--help").out
    for command in COMMANDS:
        assert command[0] in listing


def test_version(punnet) -> None:
    assert punnet("--version").out.strip() == f"punnet {__version__}"


@pytest.mark.parametrize(
    "arguments", [("detect",), ("nonsense",), ("detect", "--nonsense"), ("weigh", "--rgb")]
)
def test_wrong_command_lines_exit_with_2(punnet, arguments: tuple[str, ...]) -> None:
    result = punnet(*arguments)
    assert result.code == 2
    assert "Error" in result.err


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch):
    """Make every command raise what is given."""

    def install(error: BaseException) -> None:
        def broken(*args: object, **kwargs: object) -> None:
            raise error

        monkeypatch.setattr("punnet.cli.app.app", broken)

    return install


def test_errors_of_ours_are_one_line(punnet, failing) -> None:
    failing(PunnetError("berry 3:\n  too far"))
    result = punnet("info")
    assert (result.code, result.err) == (1, "punnet: error: berry 3: too far\n")


def test_debug_shows_the_traceback_wherever_it_stands(punnet, failing) -> None:
    failing(PunnetError("too far"))
    for arguments in (("--debug", "info"), ("info", "--debug")):
        result = punnet(*arguments)
        assert result.code == 1
        assert "Traceback" in result.err
        assert "too far" in result.err


def test_faults_ask_for_a_report(punnet, failing) -> None:
    failing(ZeroDivisionError("division by zero"))
    result = punnet("info")
    assert result.code == 70
    assert "punnet: fault: ZeroDivisionError: division by zero" in result.err
    assert "--debug" in result.err
    assert "punnet info" in result.err
    assert "Traceback" not in result.err


def test_interrupts(punnet, failing, tmp_path) -> None:
    failing(KeyboardInterrupt())
    result = punnet("info")
    assert result.code == 130
    assert "interrupted; nothing was finished" in result.err
    failing(Interrupted(tmp_path))
    assert f"interrupted; kept what was finished in {tmp_path}" in punnet("info").err


def test_info(punnet) -> None:
    facts = json.loads(punnet("info", "--json").out)
    assert facts["punnet"] == __version__
    assert facts["cores"] >= 1
    assert facts["packages"]["mujoco"][0].isdigit()
    assert any(bundle.startswith("promp-reach-sim") for bundle in facts["bundles"])
    text = punnet("info").out
    for name in ("punnet", "python", "opengl", "bundles", "memory"):
        assert any(line.startswith(name) for line in text.splitlines())


def test_info_without_opengl(punnet, monkeypatch: pytest.MonkeyPatch) -> None:
    from punnet.sim import gl_context

    gl_context.gl_backend.cache_clear()
    monkeypatch.setenv("MUJOCO_GL", "off")
    result = punnet("info", "--json")
    gl_context.gl_backend.cache_clear()
    assert result.code == 0
    assert json.loads(result.out)["opengl"].startswith("none: ")


def test_models(punnet, tmp_path) -> None:
    rows = json.loads(punnet("models", "--json").out)
    row = next(row for row in rows if row["name"] == "promp-reach-sim")
    assert row["kind"] == "promp"
    assert row["bytes"] > 1000
    assert "promp-reach-sim" in punnet("models").out
    punnet("models", tmp_path).fails_with(str(tmp_path), "no bundles")


def test_one_model(punnet) -> None:
    told = punnet("models", "sim-fast").out
    assert "train detector" in " ".join(told.split())
    assert "pluckable: mask_ap" in told
    assert "{" not in told
    assert json.loads(punnet("models", "sim-fast", "--json").out)["name"] == "sim-fast"
    punnet("models", "sim-slow").fails_with("sim-slow", "sim-fast")


def test_models_finds_damage(punnet, tmp_path) -> None:
    import shutil
    from pathlib import Path

    rows = json.loads(punnet("models", "--json").out)
    for name in ("whole", "damaged"):
        shutil.copytree(Path(rows[0]["folder"]), tmp_path / name)
    victim = next(path for path in (tmp_path / "damaged").iterdir() if path.name != "manifest.json")
    victim.write_bytes(victim.read_bytes() + b" ")
    result = punnet("models", tmp_path, "--json")
    result.fails_with("damaged", victim.name)
    assert [Path(row["folder"]).name for row in json.loads(result.out)] == ["whole"]


def test_module_and_start_up_time() -> None:
    def fastest(*arguments: str) -> float:
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
            times.append(time.perf_counter() - begin)
        return min(times)

    # 0.2 s on a quiet machine, 0.6 s is the bar; on a busy one, as a multiple of what Typer and Rich cost alone.
    alone = fastest("-c", "import typer, rich.console, rich.table")
    assert fastest("-m", "punnet", "--help") < max(0.6, 4 * alone)

"""What the package says about itself agrees with what it is."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata, resources
from pathlib import Path

import pytest

import punnet

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def project() -> dict[str, object]:
    with (ROOT / "pyproject.toml").open("rb") as stream:
        return tomllib.load(stream)


def requirement_names(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=!~\[; ]", text, maxsplit=1)[0].lower() for text in requirements}


def test_version_is_the_projects(project) -> None:
    assert punnet.__version__ == metadata.version("punnet") == project["project"]["version"]


def test_version_has_its_changelog_entry_and_citation(project) -> None:
    version = project["project"]["version"]
    assert re.search(rf"^## \[?{re.escape(version)}", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert re.search(
        rf'^version: "?{re.escape(version)}"?$', (ROOT / "CITATION.cff").read_text(), re.MULTILINE
    )


def test_every_requirement_is_pinned(project) -> None:
    pinned = requirement_names(
        [line for line in (ROOT / "constraints.txt").read_text().splitlines() if line and line[0] != "#"]
    )
    extras = project["project"]["optional-dependencies"]
    assert requirement_names(project["project"]["dependencies"]) <= pinned
    assert requirement_names(extras["train"]) <= pinned
    assert requirement_names([*extras["ros"], *extras["lerobot"]]) <= pinned
    assert requirement_names(extras["dev"]) - {"punnet"} <= pinned  # itself, with its extras


def test_extras_are_the_promised_ones(project) -> None:
    extras = set(project["project"]["optional-dependencies"])
    assert extras == {"train", "ros", "lerobot", "scale", "arms", "dev"}


def test_base_install_is_light(project) -> None:
    base = requirement_names(project["project"]["dependencies"])
    assert not base & {"torch", "torchvision", "lightning", "ray", "opencv-python"}


def test_package_data_is_there() -> None:
    package = resources.files("punnet")
    assert package.joinpath("py.typed").is_file()
    assert package.joinpath("harvest", "report_template.html").is_file()


@pytest.mark.parametrize("name", ["demo", "test", "lint", "bench", "docs"])
def test_make_has_the_promised_targets(name: str) -> None:
    assert re.search(rf"^{name}:", (ROOT / "Makefile").read_text(), re.MULTILINE)

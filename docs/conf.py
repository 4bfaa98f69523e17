"""Sphinx settings: Markdown pages by MyST, the theme Furo."""

from importlib.metadata import version as installed_version

project = "Punnet"
author = "The Punnet authors"
project_copyright = "The Punnet authors"
release = version = installed_version("punnet")

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["site"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
# Links to files of the repository that are no pages work on GitHub and are left as they are here.
suppress_warnings = ["myst.xref_missing"]

html_theme = "furo"
html_title = f"Punnet {release}"

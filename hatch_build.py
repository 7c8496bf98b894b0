"""Makes the README that goes into the package: a package index shows no picture and no file of the repository.

With a "Source" among the project's URLs, links and pictures point there; without, pictures are left out and links to
files become their text.
"""

from __future__ import annotations

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

_PICTURE = re.compile(r"!\[[^\]]*\]\((?!https?:)([^)]+)\)\n*")
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?:|#)([^)]+)\)")


def readme_for_an_index(text: str, source: str | None) -> str:
    """The README's text without links that lead nowhere.

    Args:
      text: of README.md.
      source: address of the repository's files, or None.
    """
    if source is None:
        return _LINK.sub(r"\1", _PICTURE.sub("", text))
    address = source.rstrip("/")
    absolute = _PICTURE.sub(lambda m: m[0].replace(f"({m[1]})", f"({address}/raw/HEAD/{m[1]})"), text)
    return _LINK.sub(rf"[\1]({address}/blob/HEAD/\2)", absolute)


class CustomMetadataHook(MetadataHookInterface):
    """Called by hatchling for each build."""

    def update(self, metadata: dict) -> None:
        """Sets the readme."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source")
        metadata["readme"] = {"content-type": "text/markdown", "text": readme_for_an_index(text, source)}

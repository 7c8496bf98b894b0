"""Pages of the site that are kept elsewhere in the repository, with the pictures that they show."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
ELSEWHERE = {
    "reference/configuration.md": "jrcjax/config/CONFIGURATION.md",
    "explanation/results.md": "paper_figs/README.md",
    "explanation/performance_details.md": "benchmarks/README.md",
}
"""Page of the site to the file that it is made from."""
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?:|#)([^)#]+)(#[^)]*)?\)")


def on_files(files: Files, config) -> Files:
    """Adds the pages, and each picture that is linked from them."""
    for page, path in ELSEWHERE.items():
        files.append(File.generated(config, page, content=_page(files, config, page, path)))
    return files


def _page(files: Files, config, page: str, path: str) -> str:
    """The text of a page, whose links to pictures and to other pages lead there; others become their text."""
    depth = "../" * (len(PurePosixPath(page).parts) - 1)
    pages = {source: name for name, source in ELSEWHERE.items()}

    def link(match: re.Match) -> str:
        is_picture, text, target, anchor = match[1], match[2], match[3], match[4] or ""
        found = (ROOT / path).parent.joinpath(target).resolve()
        relative = found.relative_to(ROOT).as_posix() if found.is_relative_to(ROOT) else target
        if relative in pages:
            return f"[{text}]({depth}{pages[relative]}{anchor})"
        if found.suffix not in (".png", ".csv", ".pdf") or not found.is_file():
            return text
        if files.get_file_from_path(relative) is None:
            files.append(File.generated(config, relative, abs_src_path=str(found)))
        return f"{is_picture}[{text}]({depth}{relative})"

    return _LINK.sub(link, (ROOT / path).read_text(encoding="utf-8"))

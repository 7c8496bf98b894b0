"""The site's links: pages link to files of the repository, so that they can be read there, too.

Some of these files are pages of the site, pictures and tables are copied to it, and of all others the text remains.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
ELSEWHERE = {
    "reference/configuration.md": "jrcjax/config/CONFIGURATION.md",
    "explanation/results.md": "paper_figs/README.md",
    "explanation/performance_details.md": "benchmarks/README.md",
}
"""Page of the site to the file outside of docs/ that it is made from."""
COPIED = (".png", ".csv", ".pdf")
"""What the site has of other files."""
_LINK_OR_CODE = re.compile(
    r"(?P<code>^```.*?^```|`[^`\n]+`)|(?P<mark>!?)\[(?P<text>[^\]]*)\]\((?!https?:|#)(?P<path>[^)#]+)(?P<anchor>#[^)]*)?\)",
    re.DOTALL | re.MULTILINE,
)


def on_files(files: Files, config) -> Files:
    """Adds the pages that are kept elsewhere, and each file that is linked from any page; links lead there."""
    sources = {f"docs/{file.src_uri}": file.src_uri for file in files.documentation_pages()}
    sources |= {path: page for page, path in ELSEWHERE.items()}
    for path, page in sources.items():
        text, copied = for_the_site((ROOT / path).read_text(encoding="utf-8"), path, page, sources)
        if (file := files.get_file_from_path(page)) is not None:
            files.remove(file)
        files.append(File.generated(config, page, content=text))
        for name in copied:
            if files.get_file_from_path(name) is None:
                files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    return files


def for_the_site(text: str, path: str, page: str, sources: dict[str, str]) -> tuple[str, list[str]]:
    """A page's text with links that lead somewhere on the site, and the files that it needs there.

    Args:
      text: as it is in the repository.
      path: the file that holds it, from the repository's root.
      page: its page.
      sources: all files that are pages, to their pages.
    """
    copied = []

    def link(match: re.Match) -> str:
        if match["code"]:
            return match[0]
        found = (ROOT / path).parent.joinpath(match["path"]).resolve()
        if not found.exists() or not found.is_relative_to(ROOT):
            return match[0]  # mkdocs warns of it
        target = found.relative_to(ROOT).as_posix()
        if target not in sources and found.suffix not in COPIED:
            return match["text"]
        if target not in sources:
            copied.append(target)
        there = os.path.relpath(sources.get(target, target), Path(page).parent).replace(os.sep, "/")
        return f"{match['mark']}[{match['text']}]({there}{match['anchor'] or ''})"

    return _LINK_OR_CODE.sub(link, text), copied

"""The README as the description of the package, which stands alone on an index.

A link into this tree becomes one to `Source` of `[project.urls]`; where there is none, its words
stay and pictures go. Comments are left out: they are for the tests of the examples. hatchling
calls it.
"""

import re
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_FENCED = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?:|mailto:|#)([^)\s]+)\)")


def alone(readme: str, source: str | None) -> str:
    """Return a page whose links lead somewhere wherever it is shown; source: the tree's address."""

    def led(link: re.Match[str]) -> str:
        picture, words, target = link.groups()
        if source is None:
            return "" if picture else words
        at = f"{source.rstrip('/')}/{'raw' if picture else 'blob'}/HEAD/{target}"
        return f"{picture}[{words}]({at})"

    parts = _FENCED.split(readme)
    parts[::2] = (_LINK.sub(led, _COMMENT.sub("", text)) for text in parts[::2])
    return "".join(parts)


class LongDescription(MetadataHookInterface):
    """Gives the package its description."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the readme of the metadata."""
        with open(f"{self.root}/README.md", encoding="utf-8") as file:
            text = alone(file.read(), metadata.get("urls", {}).get("Source"))
        metadata["readme"] = {"content-type": "text/markdown", "text": text}

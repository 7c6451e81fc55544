"""Reports: pages that need nothing but themselves.

`html` fills templates and sets symbols; `words` says estimates in plain words; `identification`
writes what an identification found into a folder.
"""

from swimbladder.show.report.html import inline_svg, render, symbols

__all__ = ["inline_svg", "render", "symbols"]

"""Reports: pages that need nothing but themselves.

`html` fills templates and sets symbols; `text` describes estimates;
`identification` writes what an identification found into a folder.
"""

from swimbladder.show.report.html import (
    inline_svg as inline_svg,
    render as render,
    symbols as symbols,
)

"""Reports: pages that need nothing but themselves.

`html` fills templates and sets symbols; `text` describes estimates;
`identification` writes what an identification found into a folder.
"""

from swimbladder.show.report.html import (
    render as render,
    symbols as symbols,
)

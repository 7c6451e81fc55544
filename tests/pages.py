"""What tests read of reports."""

import json
import re


def without_scripts(html):
    """A page without plotly and the data of its figures."""
    return re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)


def figures_of(html):
    """The plotly figures of a page, by name."""
    form = r'<div class="plot" role="img" data-name="([^"]+)".*?<script[^>]*>(.*?)</script>'
    return {name: json.loads(text) for name, text in re.findall(form, html, re.DOTALL)}

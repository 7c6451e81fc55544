"""`scripts/refresh_docs.py` writes what examples print, and leaves alone what still fits."""

import importlib.util

import pytest

from tests.docs.test_examples import ROOT, same

_SPEC = importlib.util.spec_from_file_location("refresh_docs", ROOT / "scripts/refresh_docs.py")
refresh_docs = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(refresh_docs)


@pytest.mark.parametrize(
    ("promised", "printed", "new"),
    [
        ("a\nb\n", "a\nb\n", "a\nb\n"),
        ("a\nb\n", "a\nc\n", "a\nc\n"),
        ("a\n...\nc told\n", "a\n1\n2\nc identified\n", "a\n...\nc identified\n"),
        ("took ... s\ntold\n", "took 1.2 s\nidentified\n", "took ... s\nidentified\n"),
        ("it told 3 in ... s\n", "it identified 3 in 1.5 s\n", "it identified 3 in ... s\n"),
        ("x  (...)  told\n", "x    (1.5)  found\n", "x    (...)  found\n"),
        ("...\nend of it\n", "1\n2\nend of all\n", "...\nend of all\n"),
        ("a\n\n", "b\n", "b\n\n"),
        ("", "b\n", "b\n"),
        ("a\n", "", ""),
        ("a\nb\nc\n", "a\nnew\nb\nc\n", "a\nnew\nb\nc\n"),
        ("a\nb\nc\n", "a\nc\n", "a\nc\n"),
    ],
)
def test_what_is_promised_anew(promised, printed, new):
    assert refresh_docs.refreshed(printed, promised) == new
    assert same(printed, new)


PAGE = """# Page

```console
$ echo one two
one two
$ printf "a 1.5 s\\nleft\\nb\\n" \\
>   | cat
a ... s
...
told
```

```python
print("x")
```

```text
y
```

<!-- exit 2 -->
```console
$ echo no; exit 2
yes
```

```console
$ exit 3
kept
```
"""


def test_a_page_is_written_anew(tmp_path):
    page, said = tmp_path / "page.md", []
    page.write_text(PAGE, encoding="utf-8")
    assert refresh_docs.refresh(page, said.append) == (True, False)
    expected = PAGE.replace("told\n", "b\n").replace("```text\ny", "```text\nx")
    assert page.read_text(encoding="utf-8") == expected.replace("yes\n", "no\n")
    assert [text.splitlines()[1:] for text in said[:3]] == [
        ["-told", "+b"],
        ["-y", "+x"],
        ["-yes", "+no"],
    ]
    assert "exit code 3, not 0" in said[3]
    page.write_text(
        PAGE.split("# Page")[1]
        .split("<!--")[0]
        .replace("told", "b")
        .replace("```text\ny", "```text\nx"),
        encoding="utf-8",
    )
    assert refresh_docs.refresh(page) == (False, True)


def test_a_block_as_on_another_page_follows_that_page(tmp_path):
    (tmp_path / "one.md").write_text("```console\n$ go\nfirst of all\nfound 3\nlast\n```\n")
    two = tmp_path / "two.md"
    two.write_text("<!-- as in one.md -->\n```console\n$ go\n...\ntold 3\nlast\n```\n")
    assert refresh_docs.refresh_quoted(two, tmp_path)
    assert two.read_text().splitlines()[2:6] == ["$ go", "...", "found 3", "last"]
    assert not refresh_docs.refresh_quoted(two, tmp_path)

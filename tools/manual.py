"""Generator of the manual that the extension opens: `python tools/manual.py` writes it from docs/guide.md.

The page is one file without scripts and without pictures. Links to other pages become text, since those are
not shipped.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from markdown import Markdown
from markdown.extensions import Extension
from markdown.extensions.toc import TocExtension
from markdown.treeprocessors import Treeprocessor

ROOT = Path(__file__).resolve().parents[1]
GUIDE = ROOT / "docs" / "guide.md"
PAGE = ROOT / "addon" / "digiclay" / "manual" / "guide.html"

STYLE = """\
:root { color-scheme: light dark; --text: #222; --page: #fff; --faint: #f1f3f5; --line: #d0d5da;
  --link: #1259a8 }
@media (prefers-color-scheme: dark) {
  :root { --text: #dcdfe3; --page: #1b1d20; --faint: #26292d; --line: #41464c; --link: #82b6f2 }
}
body { max-width: 52rem; margin: 0 auto; padding: 1.5rem 1.25rem 6rem; background: var(--page);
  color: var(--text); font: 1rem/1.55 system-ui, sans-serif }
h1, h2, h3 { line-height: 1.25; scroll-margin-top: 1rem }
h2 { margin-top: 2.5rem; padding-bottom: .3rem; border-bottom: 1px solid var(--line) }
:target { color: var(--link) }
a { color: var(--link) }
nav { padding: .75rem 1rem; border-radius: 8px; background: var(--faint) }
nav ul { margin: 0; padding-left: 1.1rem; columns: 3 9rem }
nav ul ul { columns: auto }
strong { padding: .05rem .35rem; border: 1px solid var(--line); border-radius: 4px; background: var(--faint);
  font-weight: 600; white-space: nowrap }
code { padding: .1rem .3rem; border-radius: 4px; background: var(--faint); font-size: .9em;
  overflow-wrap: anywhere }
table { width: 100%; margin: 1.25rem 0; border-collapse: collapse }
th, td { padding: .4rem .6rem; border: 1px solid var(--line); text-align: left; vertical-align: top }
th { background: var(--faint) }
td:first-child { font-weight: 600 }
li { margin: .3rem 0 }
@media print { nav { display: none } }"""

FRAME = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Digital Clay: {title}</title>
<!-- tools/manual.py makes this page from docs/guide.md -->
<style>
{style}
</style>
</head>
<body>
{body}
</body>
</html>
"""


class OnePage(Treeprocessor):
    """Removal of what leads out of the page: pictures with their paragraphs, targets of links."""

    def run(self, root: Element) -> None:
        """Change the tree of the page."""
        for parent in list(root.iter()):
            for child in [one for one in parent if one.tag == "p" and one.find("img") is not None]:
                parent.remove(child)
        for link in root.iter("a"):
            if not link.get("href", "").startswith("#"):
                link.tag, link.attrib = "span", {}


class OnePageExtension(Extension):
    """`OnePage` as the Markdown package takes it: after links and pictures are known."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Add the change of the tree."""
        md.treeprocessors.register(OnePage(md), "one_page", 10)


def make_anchor(heading: str, separator: str) -> str:
    """Return the anchor of a heading as the usual renderers make it, so that links within the guide work."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", separator)


def render(guide: str) -> str:
    """Return the page of a guide; its contents stand below its title."""
    contents = TocExtension(toc_depth="2-3", slugify=make_anchor)
    reader = Markdown(extensions=["tables", contents, OnePageExtension()])
    body = reader.convert(guide)
    nav = re.sub(r"</?div[^>]*>\s*", "", reader.toc).strip()
    title, heading, rest = re.match(r"(<h1[^>]*>(.*?)</h1>)(.*)", body, re.DOTALL).group(2, 1, 3)
    body = f'{heading}\n<nav aria-label="Contents">\n{nav}\n</nav>{rest}'
    return FRAME.format(title=title, style=STYLE, body=body)


if __name__ == "__main__":
    PAGE.write_text(render(GUIDE.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")

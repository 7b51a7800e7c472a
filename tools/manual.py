"""Generator of the manual that the extension opens: `python tools/manual.py` writes it from docs/guide.md.

The page is one file without scripts and without pictures. Links to other pages become text, since
those are not shipped.
"""

import re
from pathlib import Path
from string import Template

from markdown import Markdown
from markdown.extensions.toc import TocExtension

ROOT = Path(__file__).resolve().parents[1]
GUIDE = ROOT / "docs" / "guide.md"
PAGE = ROOT / "addon" / "digiclay" / "manual" / "guide.html"

TEMPLATE = Path(__file__).with_suffix(".html")


#: A picture with its paragraph, and a link to another page.
PICTURE, LINK = (
    re.compile(r"<p><img [^>]*></p>\n?"),
    re.compile(r'<a href="(?!#)[^"]*">(.*?)</a>', re.DOTALL),
)


def make_anchor(heading: str, separator: str) -> str:
    """Return the anchor of a heading as the usual renderers make it, so that links within the guide work."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", separator)


def render(guide: str) -> str:
    """Return the page of a guide; its contents stand below its title."""
    contents = TocExtension(toc_depth="2-3", slugify=make_anchor)
    reader = Markdown(extensions=["tables", contents])
    body = LINK.sub(r"<span>\1</span>", PICTURE.sub("", reader.convert(guide)))
    nav = re.sub(r"</?div[^>]*>\s*", "", reader.toc).strip()
    title, heading, rest = re.match(r"(<h1[^>]*>(.*?)</h1>)(.*)", body, re.DOTALL).group(2, 1, 3)
    body = f'{heading}\n<nav aria-label="Contents">\n{nav}\n</nav>{rest}'
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(title=title, body=body)


if __name__ == "__main__":
    PAGE.write_text(render(GUIDE.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")

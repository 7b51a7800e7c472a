"""Spelling of code, texts and pages: American, as Blender's own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLACES = (
    "addon",
    "benchmarks",
    "digiclay_paper",
    "digiclay_serve",
    "digiclay_study",
    "docs",
    "tests",
    "tools",
)
FILES = sorted(
    path
    for path in (
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
        *(found for place in PLACES for found in (ROOT / place).rglob("*")),
    )
    if path.suffix in (".py", ".md", ".toml", ".txt")
    # Samples of former files stay as they were written; this file has the words themselves.
    and ROOT / "tests" / "samples" not in path.parents
    and path.name not in ("test_spelling.py", "de.toml")
)
BRITISH = re.compile(
    r"colour|behaviour|neighbour|favour|honour|vapour|centre|centring|fibre|litre|metre|grey|licence|defence"
    r"|travell(ed|ing)|labell(ed|ing)|modell(ed|ing)|signall(ed|ing)|catalogue|programme\b|artefact|judgement"
    r"|ageing|aluminium|plough|mould"
    r"|(quant|normal|initial|organ|optim|minim|maxim|recogn|summar|visual|special|random|real|general"
    r"|character|synchron|emphas|util|stabil|serial)is(e|es|ed|ing|ation)\b|analys(e|ed|ing)\b",
    re.IGNORECASE,
)
#: Names in files, which stay what they are.
READ = re.compile(r'\bcentring_time\b|"(--)?colour"|"Colour by Force"|"Top Colour at \(N\)"')


def british_words(text: str) -> list[str]:
    """Return the British words of a text."""
    return [found.group() for found in BRITISH.finditer(READ.sub("", text))]


@pytest.mark.parametrize("path", FILES, ids=[str(path.relative_to(ROOT)) for path in FILES])
def test_no_word_is_spelled_the_british_way(path: Path) -> None:
    assert british_words(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Mode Colours", ["Colour"]),
        ("the centred neighbours", ["centre", "neighbour"]),
        ("quantised, otherwise a rise in noise", ["quantised"]),
        ('{"colour": "color"}', []),
    ],
)
def test_the_check_finds_british_words_and_them_alone(text: str, found: list[str]) -> None:
    assert british_words(text) == found

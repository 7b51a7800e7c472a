"""TOML text: size check of external text before parsing, and values as text."""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

#: Most bytes of a text: the heights of the largest bed, 20 million cells, packed, take 107 MB of them.
LARGEST = 128_000_000
#: Most names of a dotted key, each of which is kept with all before it; most letters of a word or a number.
PARTS, LETTERS = 16, 1000
_NAME = r'(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|\'[^\'\n]*+\')'
#: What a text is made of, as far as it matters here: a key of too many names, a word, texts, a comment.
#: Nothing is gone over twice: a text without an end reaches as far as it can.
_PIECES = re.compile(
    rf"(?P<key>{_NAME}(?:[ \t]*+\.[ \t]*+{_NAME}){{{PARTS}}})|(?P<word>[A-Za-z0-9_-]++)"
    r'|"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?|\'\'\'(?:[^\']|\'(?!\'\'))*+(?:\'\'\')?'
    r'|"(?:[^"\\\n]|\\.)*+"?|\'[^\'\n]*+\'?|#[^\n]*+',
    re.DOTALL,
)


def parse_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises ValueError when it is no TOML, or too long; the message ends with ``(at line ...)`` where that is
    known. Raises RecursionError when lists or tables are nested too deeply.
    """
    if len(text) > LARGEST:
        raise ValueError(f"must have at most {LARGEST // 1_000_000} MB (got {len(text) / 1e6:.0f} MB)")
    for piece in _PIECES.finditer(text):
        if piece["key"]:
            said = f"a key must have at most {PARTS} names, got {piece['key'][:20]}..."
        elif piece["word"] and len(piece["word"]) > LETTERS:
            said = f"a word or number must have at most {LETTERS} letters, got {len(piece['word'])}"
        else:
            continue
        line = text.count("\n", 0, piece.start()) + 1
        raise ValueError(f"{said} (at line {line})")
    return tomllib.loads(text)


def format_value(value: Any) -> str:
    """Write a text, number, truth value, or a list of them; a float reads back as the same one."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's; only TOML wants the delete character escaped as well.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)

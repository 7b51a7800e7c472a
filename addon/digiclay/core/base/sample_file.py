"""Files by user input: a sample by its name, anything else by its path."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from .errors import SceneError
from .quantity import find_nearest_name


def list_files(folder: Path, *kinds: str) -> dict[str, Path]:
    """Return the samples of a folder by their names: its files that end with one of `kinds`.

    `kinds`: endings of names, with the dot.
    """
    return {path.stem: path for path in sorted(folder.iterdir()) if path.suffix in kinds}


def find_file(word: str, samples: Mapping[str, Path], kind: str) -> Path:
    """Return the file a word stands for.

    `word`: a sample's name, or a path; `kind`: what messages call a sample. Raises SceneError when there is
    no such file, or sample.
    """
    if word in samples:
        return samples[word]
    if os.path.isfile(word):  # unlike Path.is_file it takes any text, however odd or long
        return Path(word)
    if Path(word).suffix or Path(word).name != word:
        raise SceneError(f"{word}: there is no such file.")
    close = find_nearest_name(word, list(samples))
    asked = f" Did you mean {close}?" if close else ""
    raise SceneError(f"{word or repr(word)} is neither a file nor a {kind} ({', '.join(samples)}).{asked}")

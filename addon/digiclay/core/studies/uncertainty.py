"""Uncertainty of fitted parameters: members of a scene, drawn from their covariance, and bands of figures."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Flags, Floats
from ..base.errors import ParameterError, SceneError
from ..files.tables import Table, refuse_unknown, shorten
from ..scene.scene_source import Setting, load, read_parts, read_table, write_word
from ..scene.schema import Scene
from ..scene.toml_table import UNCERTAINTY
from .axes import Point, find_numbers, place_points

#: Correlations below this number are rounding of the file.
ROUNDING = 1e-6


class Fitted(NamedTuple):
    """Joint normal distribution of the parameters of a fitted file, sorted: a file may have any order."""

    keys: list[str]
    center: Floats
    """(k,): Values of the scene, as logarithms where `logarithms`, (k,)."""
    logarithms: Flags
    root: Floats
    """(k, k): Multiplied by its transpose it is the covariance."""

    def draw(self, random: np.random.Generator, count: int) -> Floats:
        """Return the values of members, (n, k)."""
        values = self.center + random.standard_normal((count, len(self.keys))) @ self.root.T
        with np.errstate(over="ignore"):  # infinity is outside of every range
            np.exp(values, out=values, where=self.logarithms)
        return values


class Members(NamedTuple):
    """Members of a scene: names of what varies, points, and how they were drawn."""

    keys: list[str]
    points: list[Point]
    note: str


def draw_members(
    files: Sequence[Path], path: Path, settings: Sequence[Setting], count: int, seed: int
) -> Members:
    """Draw members of a scene whose settings have the parts of fitted files.

    What the scene does not permit is drawn again. SceneError in one line if that is more than half of all
    draws, and for a file: its field, rule and value.
    """
    scene = load(path, settings)
    again = load(path, [*settings, *(part for file in files for part in read_parts(file))])
    fitted = []
    for file in files:
        try:
            fitted.append(_read(read_table(file).get(UNCERTAINTY), scene, again))
        except ParameterError as error:
            raise SceneError(f"{file}: {error}") from None
    fitted.sort(key=lambda each: each.keys)
    keys = [key for each in fitted for key in each.keys]
    _require("keys", len(set(keys)) == len(keys), "must not name a parameter twice", keys)
    random = np.random.default_rng(seed)
    points, refused = list[Point](), list[Point]()
    while len(points) < count:
        values = np.hstack([each.draw(random, count - len(points)) for each in fitted])
        rows = [tuple(map(write_word, row)) for row in values.tolist()]
        drawn = place_points(path, settings, keys, rows, option="--uncertain")
        points += [point for point in drawn if point.scene]
        refused += [point for point in drawn if not point.scene]
        if len(refused) > count:
            raise SceneError(f"More than half of all members cannot be, such as {refused[0].error}")
    points = [replace(point, index=number) for number, point in enumerate(points)]
    more = f"; {len(refused)} more drawn again: {refused[0].error}" if refused else ""
    return Members(keys, points, f"{count} members, seed {seed}{more}")


def _require(field: str, holds: object, rule: str, value: object) -> None:
    """Refuse a field of the table that breaks a rule."""
    if not holds:
        raise ParameterError(UNCERTAINTY, field, rule, shorten(repr(value)))


def _read(table: Any, scene: Scene, again: Scene) -> Fitted:
    """Return the content of a file's table; `again`: the scene with the parts of the files on top."""
    _require("", isinstance(table, dict), "must be a table, as digiclay fit writes it", table)
    refuse_unknown(UNCERTAINTY, table, ("keys", "logarithms", "covariance"))
    given = table.get("keys")
    _require("keys", given and isinstance(given, list), "must be a list of at least 1 text", given)
    size = len(given)
    keys = _read_array(table, "keys", "U", "texts", size)
    flags = _read_array(table, "logarithms", "b", "of true and false", size)
    covariance = _read_array(table, "covariance", "if", "numbers", size, size)
    center = np.empty(size)
    for number, key in enumerate(given):
        values = find_numbers(scene, key)
        rule = "must be in the scene, a number that all fingers share"
        _require("keys", len(values) == 1, rule, key)
        rule = "must not be changed by other options"
        _require("keys", values == find_numbers(again, key), rule, key)
        rule = "must be of numbers above 0"
        _require("logarithms", values[0] > 0.0 or not flags[number], rule, key)
        center[number] = np.log(values[0]) if flags[number] else values[0]
    order = np.argsort(keys)
    root = find_root(covariance[np.ix_(order, order)])
    return Fitted(keys[order].tolist(), center[order], flags[order], root)


def _read_array(table: Table, field: str, kinds: str, what: str, *shape: int) -> Array:
    """Return a list of the table as an array of a shape and of one of NumPy's kinds."""
    try:
        values = np.array(table.get(field))
    except ValueError:  # lists of different lengths
        values = np.array(None)
    rule = f"must be {' x '.join(map(str, shape))} {what}"
    _require(field, values.dtype.kind in kinds and values.shape == shape, rule, table.get(field))
    return values


def find_root(covariance: Floats) -> Floats:
    """Return the matrix that gives a covariance, multiplied by its transpose; ParameterError if none does."""
    scale = np.sqrt(np.abs(np.diag(covariance)))
    with np.errstate(all="ignore"):  # what is not finite has no correlation of at most 1
        correlation = covariance / np.outer(scale, scale)
        lopsided = np.abs(correlation - correlation.T)
    rule = "must be finite, symmetric and positive definite, but for rounding"
    sound = (np.abs(correlation) <= 1.001) & (lopsided <= ROUNDING)
    _require("covariance", sound.all(), rule, covariance.tolist())
    values, vectors = np.linalg.eigh(correlation)
    _require("covariance", values[0] > -ROUNDING, rule, covariance.tolist())
    root: Floats = scale[:, None] * vectors * np.sqrt(np.where(values > ROUNDING, values, 0.0))
    return root

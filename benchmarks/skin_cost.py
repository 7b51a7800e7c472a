"""Processor time of evaluating a bed whose pins have moved: with pins, with a skin, and with both."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import numpy as np
from digiclay import bridge
from digiclay.compat import bpy, scratch
from digiclay.core.model.layout import Layout
from digiclay.device import form, view
from digiclay.device.instant import Instant

#: What is drawn, by turns: form, and kind of skin.
SHOWN = (("pins", "smooth"), ("skin", "smooth"), ("skin", "membrane"), ("both", "smooth"))
#: Evaluations in a row before another form has its turn; the first of them is not counted.
IN_A_ROW = 6


@dataclass(frozen=True)
class SkinCost:
    """Median processor times for one bed, all threads together, s.

    Attributes
    ----------
    pins : int
    evaluate : tuple of float
        For each of `SHOWN`.
    """

    pins: int
    evaluate: tuple[float, ...]


def measure_skin(rows: int, columns: int, updates: int) -> SkinCost:
    """Move all pins of a bed again and again, and time what Blender does then, drawing excepted.

    `updates`: how many are timed for each form, at least.
    """
    instant = Instant.at_rest(Layout(rows=rows, columns=columns))
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, len(instant.height)))
    spent: list[list[float]] = [[] for _ in SHOWN]
    with scratch():
        bed = view.build(instant, bpy.context.scene.collection)
        while len(spent[0]) < updates:
            for times, (shown, kind) in zip(spent, SHOWN, strict=True):
                form.set_form(bed, shown)
                form.set_kind(bed, kind)
                for count in range(IN_A_ROW):
                    bridge.write_cells(bed.data, instant.position, instant.height + noise[count % 2])
                    started = time.process_time()
                    bpy.context.evaluated_depsgraph_get()
                    if count:
                        times.append(time.process_time() - started)
    return SkinCost(rows * columns, tuple(statistics.median(times) for times in spent))

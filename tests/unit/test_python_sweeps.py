"""Sweeps from Python: tables with errors, batches, points that fail."""

import re
from pathlib import Path

import digiclay
import numpy as np
import pandas
import pytest
from digiclay import DigiclayError
from digiclay.core.session.run_scene import run as simulate

from tests.assemble import refused_in_a_line
from tests.own_methods import Mine, write_method

pytestmark = pytest.mark.usefixtures("here", "no_methods")


def test_a_sweep_is_a_table_with_errors_that_numpy_and_pandas_read(tap):
    counts = []
    varied = {"control.force_gain": np.array([1.0, 2.0]), "valve.stroke": ["20 um", "30 um"]}
    table = digiclay.sweep(
        tap, varied, ["max_total_force", "lag", "height_error"], lambda *n: counts.append(n)
    )
    assert counts == [(4, 4)]  # points of one bed run in one batch
    np.testing.assert_array_equal(table["control.force_gain"], [1.0, 1.0, 2.0, 2.0])
    np.testing.assert_allclose(table["valve.stroke"], [2e-5, 3e-5, 2e-5, 3e-5])
    names = "max_total_force lag_mean height_error run_time force_error lost error"
    assert list(pandas.DataFrame(table).columns) == [*varied, *names.split()]
    # As of a run of its own, up to the rounding of a batch.
    for row in table:
        changes = {key: float(row[key]) for key in varied}
        alone = digiclay.run(digiclay.scene(tap, changes)).metrics
        for name in ("max_total_force", "height_error", "force_error"):
            assert row[name] == pytest.approx(alone[name], rel=1e-6), name
    assert set(table["error"]) == {""}


def test_a_sweep_over_methods_has_their_names_also_of_ones_own(tap):
    write_method(Path())
    table = digiclay.sweep(
        tap, {"control.method": ["plastic", "pad.py:SoftPad", Mine]}, "max_total_force"
    )
    assert list(table["control.method"]) == ["plastic", "soft_pad", "mine"]
    alone = simulate(digiclay.scene(tap, {"control.method": Mine}))
    assert table["max_total_force"][2] == pytest.approx(alone.metrics["max_total_force"], rel=1e-9)


def test_points_that_fail_have_their_reason_and_no_number(tap):
    varied = {"layout.pitch": ["3 mm", "4 mm"], "actuator.bore": ["2 mm", "3.5 mm"]}
    table = digiclay.sweep(tap, varied, "max_total_force")
    failed = table["error"] != ""
    assert failed.tolist() == [False, True, False, False]
    assert np.isnan(table["max_total_force"]).tolist() == failed.tolist()


@pytest.mark.parametrize(
    "varied, metrics, message",
    [
        ({}, ["rfd"], "A sweep must vary at least one key: {key: values} (got {})."),
        (["control.force_gain"], ["rfd"], "A sweep must vary at least one key"),
        (
            {"control.force_gain": []},
            ["rfd"],
            "control.force_gain must be varied over at least one value",
        ),
        (
            {"control.force_gain": 3},
            ["rfd"],
            "control.force_gain must be varied over a list of values (got 3)",
        ),
        (
            {"control.force_gain": "1,2"},
            ["rfd"],
            "control.force_gain must be varied over a list of values",
        ),
        (
            {"control.force_gain": [1, 2, 1]},
            ["rfd"],
            "control.force_gain must not have a value twice",
        ),
        (
            {"control.force_gain": [1, -2]},
            ["rfd"],
            "sweep: control.force_gain must be at least 0 1/N (got -2",
        ),
        (
            {"control.force_gian": [1]},
            ["rfd"],
            "sweep: control.force_gian must be a known key (got 1). Did",
        ),
        ({"control.force_gain": range(20_000)}, ["rfd"], "sweep must come to 10000 points at most"),
        (
            {"control.force_gain": [1]},
            ["rdf"],
            "metrics must be a known metric (got 'rdf'). Did you mean rfd?",
        ),
        ({"control.force_gain": [1]}, None, "metrics must be a list of metrics (got None)."),
        (
            {"recorder": ["absent"]},
            ["rfd"],
            "A sweep needs a recorder, and the scene has recorder = 'ab",
        ),
    ],
)
def test_a_sweep_that_cannot_be_is_refused_in_one_line(tap, varied, metrics, message):
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}"):
        digiclay.sweep(tap, varied, metrics)

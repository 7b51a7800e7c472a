"""What one control period of smoothing makes of any relief, under any disc."""

import numpy as np
from digiclay.core.control.exchange import make_exchange
from digiclay.core.control.orders import STRONGEST, Orders, Verb, order_periods
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.null_parts import Uncontrolled
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from hypothesis import given
from hypothesis import strategies as st

CELL = assemble(resolve({})).cell
STROKE = CELL.actuator.stroke
layouts = st.builds(
    Layout,
    rows=st.integers(1, 7),
    columns=st.integers(1, 7),
    pitch=st.floats(0.3e-3, 6e-3),
    arrangement=st.sampled_from(["aligned", "staggered", "hexagonal"]),
)
orders = st.tuples(
    st.floats(-30e-3, 30e-3),
    st.floats(-30e-3, 30e-3),
    st.floats(1e-3, 30e-3),
    st.floats(0.01, STRONGEST),
    st.sampled_from([Verb.SMOOTH, Verb.AVERAGE]),
)


def measure_steps(grid, height):
    pairs = make_exchange(grid, 1e-6, 1e-3).find_pairs(np.arange(grid.count))
    return float(
        sum(share * ((height[one] - height[other]) ** 2).sum() for one, other, share in pairs)
    )


@given(layouts, orders, st.integers(0, 2**32 - 1))
def test_smoothed_heights_keep_sum_range_and_what_is_outside_and_are_never_rougher(
    layout, order, seed
):
    grid = make_grid(layout)
    height = np.random.default_rng(seed).uniform(0.0, STROKE, grid.count)
    cells, none = np.arange(grid.count), np.zeros(grid.count)
    seen = Measurement(
        grid.compute_basis(cells),
        height,
        none,
        height.copy(),
        np.zeros(grid.count, np.int8),
        np.empty((0, grid.count)),
        cells,
    )
    (control,) = order_periods(Uncontrolled(), grid, CELL, 5e-3, Orders(np.array([order])))
    _, commands = control.command(None, seen)
    target, (x, y, radius, *_) = commands.target, order
    outside = np.hypot(grid.x - x, grid.y - y) > radius * (1.0 + 1e-9)
    np.testing.assert_array_equal(target[outside], height[outside])
    # Rounding of heights of 0.1 m.
    assert abs(float((target - height).sum())) < 1e-15 * grid.count
    assert target.min() >= height.min() - 1e-15
    assert target.max() <= height.max() + 1e-15
    if order[-1] == Verb.AVERAGE:
        assert measure_steps(grid, target) <= measure_steps(grid, height) * (1.0 + 1e-12)
    else:
        assert float((target**2).sum()) <= float((height**2).sum()) * (1.0 + 1e-12)
    assert np.isfinite(commands.command).all()
    assert np.abs(commands.command).max() <= 1.0

"""A control period takes the same work on a bed of any size."""

from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble

from benchmarks.bed_size import measure_bytes, scene
from benchmarks.session_parts import period_calls

#: Sides of the beds: 625 and 40,401 pins; both have a pin in the middle.
SMALL, LARGE = 25, 201


def test_on_40000_pins_as_many_cells_take_part_in_as_many_numpy_calls_as_on_625():
    def count(side):
        bed = scene(side)
        system = assemble(bed)
        run = periods(system, bed.trajectories(), begin(system), bed.periods)
        return [state.active.cells.size for state in run]

    small = count(SMALL)
    assert max(small) > 100
    assert count(LARGE) == small

    def calls(side):
        bed = scene(side)
        return period_calls(assemble(bed), bed.trajectories(), 120)[0]

    small = calls(SMALL)
    assert max(small) > 100
    assert calls(LARGE) == small


def test_the_bytes_of_a_pin_are_those_of_its_rows_place_mode_and_age():
    # Nine rows and the age as float64, x and y, and one byte of mode; what is left over is a few
    # kilobytes.
    least = ((9 + 1 + 2) * 8 + 1) * LARGE * LARGE
    assert 0 <= measure_bytes(LARGE) - least < 20_000

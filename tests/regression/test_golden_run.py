"""Two runs, digit for digit: what changes a parameter by a part in 1e9 is seen.

The first nine seconds of the paper's session, where every flow is laminar; and one pin whose valve
follows a script, pressed while its flow is turbulent. Compared are not bits, since other processors
and other versions of numpy take sums in another order, but numbers, with a tolerance between two
measurements. The contact's exponent moved by a part in 1e15, which is what rounding does, moves
these forces by 2e-14 N and heights by 1e-16 m. Moved by a part in 1e9 it moves them by 1e-10 N and
2e-12 m.
"""

import json

import pytest

from tests.renew import GOLDEN, REMEDY, collect_golden, run_golden

#: N and mm: hundreds of times what rounding does, a tenth or less of what a part in 1e9 does.
FORCE, HEIGHT, WEIGHED = {"abs": 1e-11}, {"abs": 1e-10}, {"rel": 1e-12}
TOLERANCES = {
    "forces": FORCE,
    "heights": HEIGHT,
    "weighed": WEIGHED,
    "scripted_heights": HEIGHT,
    "scripted_forces": FORCE,
}


@pytest.fixture(scope="module")
def golden():
    """Return the present numbers."""
    return collect_golden()


@pytest.mark.parametrize("name", TOLERANCES)
def test_the_numbers_of_the_runs_are_what_they_were(golden, name):
    stored = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert golden[name] == pytest.approx(stored[name], **TOLERANCES[name]), REMEDY


def test_a_part_in_1e9_is_seen():
    stored = json.loads(GOLDEN.read_text(encoding="utf-8"))
    moved = run_golden(f"contact.exponent={2000.0 * (1.0 + 1e-9)!r}")
    for name, found in moved.items():
        assert found != pytest.approx(stored[name], **TOLERANCES[name])


def test_every_parameter_is_declared_as_it_was(golden):
    stored = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert json.loads(json.dumps(golden["parameters"])) == stored["parameters"], REMEDY

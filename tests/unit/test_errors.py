"""What can go wrong is said in one line."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, DivergenceError, ParameterError
from digiclay.core.model.contact import Contact

from tests.assemble import Record, one_cell, path, record, scripted
from tests.timeouts import TIMEOUT


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (
            ParameterError("Valve", "stroke", "must be above 0 m", "-1 m", "Is it in µm?"),
            "Valve.stroke must be above 0 m (got -1 m). Is it in µm?",
        ),
        (ParameterError("Supply", "", "must be whole", "half"), "Supply must be whole (got half)."),
        (
            DivergenceError(1.25, 312, "force", float("inf"), "Use a shorter step."),
            "At 1.25 s the force of cell 312 became inf. Use a shorter step.",
        ),
    ],
)
def test_an_error_that_a_user_can_cause_is_one_line(error: Exception, line: str) -> None:
    assert isinstance(error, DigiclayError)
    assert str(error) == line


def run_too_stiff(stepper: str) -> Record:
    """Return a stiff scene's record, with steps far beyond the limit of explicit methods."""
    system = one_cell(
        contact=Contact(exponent=2e4),
        period=50e-3,
        step=50e-3,
        stepper=stepper,
        control=scripted(lambda t, x, y: 1.0),
    )
    return record(system, path((0, 0, 0, 40.5), (1, 0, 0, 35.0)), 200)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_an_explicit_method_that_leaves_the_finite_numbers_is_reported() -> None:
    with pytest.raises(
        DivergenceError, match=r"^At [\d.]+ s the \w+ of cell 0 became (nan|inf|-inf)\. Use a shorter"
    ):
        run_too_stiff("runge_kutta_4")


def test_the_closed_form_step_does_not_diverge_where_the_explicit_one_does() -> None:
    rows = run_too_stiff("bernoulli").rows
    assert len(rows) == 201
    assert np.isfinite(rows).all()


def test_a_warning_of_numpy_is_an_error_in_the_processes_that_tests_start() -> None:
    code = "import numpy; numpy.exp(numpy.array([1000.0]))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    assert done.returncode == 1
    assert "RuntimeWarning: overflow encountered in exp" in done.stderr

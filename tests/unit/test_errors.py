"""What can go wrong is said in one line."""

from __future__ import annotations

import subprocess
import sys

import pytest
from digiclay.core.base.errors import DigiclayError, DivergenceError, ParameterError

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


def test_a_warning_of_numpy_is_an_error_in_the_processes_that_tests_start() -> None:
    code = "import numpy; numpy.exp(numpy.array([1000.0]))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    assert done.returncode == 1
    assert "RuntimeWarning: overflow encountered in exp" in done.stderr

"""Errors with a message of one line: owner, field, rule and value."""

from collections.abc import Iterator
from contextlib import contextmanager

#: Characters of a message, and of a value in it.
LONGEST, VALUE = 400, 160


def one_line(text: object, most: int = LONGEST) -> str:
    """Return a text as one line of limited length, without control characters.

    A longer one is cut to its beginning, which has the error, and its end, which has the remedy.
    """
    line = " ".join(str(text).split())
    line = "".join(
        letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in line
    )
    beginning = most * 3 // 5
    return line if len(line) <= most else f"{line[:beginning]} ... {line[beginning + 5 - most :]}"


class DigiclayError(Exception):
    """Base of all errors that a user can cause; its text is one line of limited length."""

    def __init__(self, text: object = "") -> None:
        super().__init__(one_line(text))


class ParameterError(DigiclayError, ValueError):
    """Parameter that breaks a rule, which begins with ``must``; the value has its unit, the hint a remedy.

    The owner is the part as users know it (``"Valve"``); the field is empty for a rule on several.
    """

    def __init__(self, owner: str, field: str, rule: str, value: str, hint: str = "") -> None:
        value = one_line(value, VALUE)
        self.owner, self.field, self.rule, self.value, self.hint = owner, field, rule, value, hint
        name = f"{owner}.{field}" if field else owner
        super().__init__(f"{name} {rule} (got {value})." + (f" {hint}" if hint else ""))


class SceneError(DigiclayError):
    """Invalid scene file or ``--set`` value."""


class MethodError(DigiclayError):
    """Control method of one's own that breaks a rule; its text names file, class and rule."""


class OutputError(DigiclayError):
    """Result that cannot be written, or run folder that cannot be read."""


@contextmanager
def explain_os_error(rule: str, kind: type[DigiclayError] = OutputError) -> Iterator[None]:
    """Raise an OSError within the block as an error of ours: the rule, and the reason."""
    try:
        yield
    except OSError as error:
        raise kind(f"{rule}: {error.strerror or error}.") from None


class BusyError(OutputError):
    """File or folder in use by another process."""


class StateError(DigiclayError):
    """Snapshot that cannot be restored."""


class DivergenceError(DigiclayError, ArithmeticError):
    """Integration with values that are not finite: time, s, first cell, its quantity and value."""

    def __init__(self, time: float, cell: int, quantity: str, value: float, remedy: str) -> None:
        self.time, self.cell, self.quantity, self.value, self.remedy = (
            time,
            cell,
            quantity,
            value,
            remedy,
        )
        super().__init__(
            f"At {time:.6g} s the {quantity} of cell {cell} became {value:g}. {remedy}"
        )

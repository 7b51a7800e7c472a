"""Progress on a terminal: one line that tells how much is done, and is gone afterwards."""

import io

import pytest
from digiclay.commands.progress import PAUSE, Bar, Counted, format_duration

from benchmarks.report import Steps

#: Each kind of progress, and one step of it of three.
KINDS = {
    "session": lambda stream: Bar(stream, "tap", 5e-3),
    "counted": lambda stream: Counted(stream, "film", "frames"),
    "steps": lambda stream: Steps(stream, "stiff", 3),
}


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """Give a clock that stands still until its only number is changed, s."""
    now = [100.0]
    monkeypatch.setattr("digiclay.commands.progress.time.monotonic", lambda: now[0])
    return now


def told(bar):
    bar() if isinstance(bar, Steps) else bar(1, 3)  # type: ignore[operator]


@pytest.mark.parametrize("kind", KINDS)
def test_a_terminal_gets_the_share_done_and_the_time_left_in_a_line_that_goes_and_a_file_gets_nothing(
    kind, clock
):
    for stream in (Terminal(), io.StringIO()):
        with KINDS[kind](stream) as bar:
            clock[0] += 10.0
            told(bar)
            drawn = stream.getvalue()
            clock[0] += 0.9 * PAUSE  # not drawn again before anybody could read it
            told(bar)
            assert stream.getvalue() == drawn
        if not stream.isatty():
            assert drawn == ""
            continue
        # A third took ten seconds: of 28 cells 9 are full, and 20 s are left.
        assert f"[{'#' * 9}{'.' * 19}]" in drawn
        assert ", 20 s left" in drawn
        assert stream.getvalue().endswith("\r\033[K")


def test_a_line_is_cut_to_the_terminal_and_things_done_beforehand_do_not_count_for_the_time_left(
    clock, monkeypatch
):
    stream = Terminal()
    with Counted(stream, "first", "jobs", before=8) as bar:
        clock[0] += 10.0
        bar(9, 10)
    # One job took ten seconds, so the last one will.
    assert "9 of 10 jobs, 10 s left" in stream.getvalue()
    monkeypatch.setenv("COLUMNS", "40")
    stream = Terminal()
    with Counted(stream, "a name that is rather long", "frames") as bar:
        clock[0] += 10.0
        bar(1, 3)
        line = stream.getvalue().removeprefix("\r").removesuffix("\033[K")
    # A character in the last column would already begin the next line on some terminals.
    assert len(line) == 39


@pytest.mark.parametrize(
    "seconds, said", [(0.4, "0 s"), (59.4, "59 s"), (200.0, "3 min 20 s"), (7500.0, "2 h 5 min")]
)
def test_times_are_written_as_people_say_them(seconds, said):
    assert format_duration(seconds) == said

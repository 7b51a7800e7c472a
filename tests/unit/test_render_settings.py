"""Which recorded rows a film shows, and when."""

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.session.render_settings import Film, Turntable

from tests.assemble import assert_near

TIME = np.arange(201) * 5e-3


def test_a_film_lasts_as_long_as_its_session_or_a_part_of_it_and_shows_the_nearest_row():
    moments = Film(rate=25).moments(TIME)
    assert len(moments) == 26
    assert_near(moments, np.arange(26) / 25, 1e-12)
    assert len(Film(rate=25, speed=0.5).moments(TIME)) == 51
    assert Film().rows([0.0]).tolist() == [0]  # a session of a single row
    film = Film(rate=25, start=0.2, stop=0.4)
    assert TIME[film.rows(TIME)][[0, -1]].tolist() == pytest.approx([0.2, 0.4], abs=1e-12)
    uneven = np.array([0.0, 0.1, 0.5, 0.52, 1.0])
    film = Film(rate=10)
    wanted = [int(np.abs(uneven - moment).argmin()) for moment in film.moments(uneven)]
    assert film.rows(uneven).tolist() == wanted


@pytest.mark.parametrize(
    "film, told",
    [
        (Film(start=2.0), "start must be between 0 s and 1 s"),
        (Film(start=0.5, stop=0.4), r"between 0 s and 0\.4 s"),
        (Film(speed=1e-3, rate=240), "speed must be so high that there are at most 100000 frames"),
    ],
)
def test_a_part_that_is_not_there_is_refused(film, told):
    with pytest.raises(ParameterError, match=told):
        film.moments(TIME)


def test_a_turntable_goes_round_once_without_showing_the_first_frame_twice():
    np.testing.assert_allclose(
        np.degrees(Turntable(frames=4).angles()), [0, 90, 180, 270], atol=1e-12
    )

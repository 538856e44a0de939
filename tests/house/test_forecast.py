"""How long a round will go on, from what is done of it."""

from fracjax._computing import counting, map_in_threads
from fracjax._show import Forecast


def test_the_rate_so_far_is_that_of_the_rest(monkeypatch):
    clock = iter((0.0, 100.0, 106.0, 118.0, 140.0))
    monkeypatch.setattr("fracjax._show._forecast.time.monotonic", lambda: next(clock))
    forecast, texts = Forecast(), []
    for done in (0, 2, 6, 8):
        forecast.count(done, 8)
        texts.append(forecast.text)
    # 2 in 6 s: 18 s for 6 more; 6 in 18 s: 6 s for 2 more.
    said = "{} of 8, about {} s more of this round"
    assert texts == ["", said.format(2, 18), said.format(6, 6), ""]


def test_what_threads_have_done_is_counted_in_their_context_alone():
    counts = []
    with counting(lambda done, total: counts.append((done, total))):
        map_in_threads(lambda k: map_in_threads(abs, [k, k]), [1, 2, 3])
    map_in_threads(abs, [1, 2])
    assert counts == [(0, 3), (1, 3), (2, 3), (3, 3)]

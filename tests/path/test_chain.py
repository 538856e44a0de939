"""Effects in series with the path, of any size, against SciPy and dense matrices."""

import numpy as np
import pytest
from scipy.signal import lsim

from fracjax._path import Stage, Whitening, view_of
from fracjax._path import _kernels as kernels
from fracjax._path import _law as law_module
from fracjax._path._chain import Fitted, Line, _changes, _quadratic, adequacy, fitted
from fracjax._path._drive import delayed, limited
from fracjax._path._expansion import Expansion
from fracjax._path._filters import Filter, corner_of, filters_of
from fracjax._path._law import PathLaw, Settled
from fracjax._path._signal import response_of
from tests.path.helpers import plays, signal_of, through, twin_rates

STEP, NOISE = 1e-3, 1e-3
DRIVE = twin_rates()
TIMES = STEP * np.arange(DRIVE.size)
LAW = plays(DRIVE)
FALLING = through(0.5 + 0.5 * (-1.0) ** np.arange(40) * np.linspace(1, 0.1, 40), [30] * 39)
"""A drive whose every branch is met once, so that curves spend much."""


def behind(numerator, denominator, signal) -> np.ndarray:
    return signal[0] + lsim((numerator, denominator), signal - signal[0], TIMES, interp=True)[1]


@pytest.mark.parametrize("periodic", [False, True])
def test_a_filter_is_what_its_recursions_add(periodic):
    signal = np.cos(2 * np.pi * np.arange(300) / 300) + 0.2
    departures = [kernels.lag(0.01, STEP, 2), kernels.mode(30.0, 0.1, STEP)]
    exact = signal
    for one in departures:
        exact = exact + kernels.Convolution(exact, STEP, periodic=periodic).with_departure(one)
    filtered = Filter([signal.size], [departures], [periodic])
    # The last sample of steady cycles is the first one's neighbour, which a convolution lacks.
    np.testing.assert_allclose(filtered(filtered.nodes(signal))[:-1], exact[:-1], atol=1e-4)
    determinants = [np.linalg.slogdet(one.after.toarray())[1] for one in filtered.sections]
    assert filtered.log_determinant == pytest.approx(sum(determinants), abs=1e-9)


def test_inner_products_behind_filters_are_those_of_the_covariance():
    drives = [through([0.0, 1.0, 0.2, 0.9], [16] * 3), through([0.1, 0.8, 0.2], [15] * 2)]
    sizes = [d.size for d in drives]
    size = sum(sizes)
    whitening = Whitening(
        [np.array([1.0, -0.6]) / 0.02, np.array([1 / 0.03])], [np.ones(n) for n in sizes]
    )
    departures = [[kernels.lag(0.002, STEP), kernels.mode(40.0, 0.05, STEP)]] * 2
    filtered = Filter(sizes, departures, [False, False])
    law = PathLaw.of(drives, whitening, 1.2, filter=filtered)
    settled = Settled(law, 0.3, 0.03)
    normal = law.bends.toarray() / 0.3**2 + np.eye(law.columns) / law.span**2
    dense = np.concatenate([filtered(law.fading) * 0.03 * law.span, law.own], axis=1)
    curve = filtered(law.splines(law.nodes(law.drive)).toarray())
    covariance = curve @ np.linalg.inv(normal) @ curve.T + dense @ dense.T
    through_rest = np.eye(size)
    for k, one in reversed(list(enumerate(filtered.sections))):
        inverse = through_rest @ np.linalg.inv(one.after.toarray())
        loose = np.hypot(law_module._LOOSE * law.noise, law.loose if k == 0 else 0.0)
        deviation = loose * np.abs(one.gain)
        covariance += inverse @ np.diag(deviation**2) @ inverse.T
        through_rest = inverse @ one.before.toarray()
    white = whitening(np.eye(size))
    covariance = np.eye(size) + white @ covariance @ white.T
    response = np.random.default_rng(2).standard_normal(size)
    inner = settled.prior.inner(np.zeros((size, 0)), response)
    assert inner.square == pytest.approx(response @ np.linalg.solve(covariance, response), rel=1e-6)
    assert inner.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-6)
    assert settled.freedom == pytest.approx(
        size - np.trace(np.linalg.inv(covariance)), abs=3 * np.sqrt(2 * size / law_module._PROBES)
    )


def test_a_drive_is_late_by_any_time_and_its_rate_limited():
    t = np.arange(400.0)
    sine = np.sin(2 * np.pi * t / 100)
    late = delayed(sine, 7.4, periodic=True)
    np.testing.assert_allclose(late, np.sin(2 * np.pi * (t - 7.4) / 100), atol=2e-4)
    np.testing.assert_allclose(delayed(sine, 807.4, periodic=True), late, atol=1e-9)
    assert delayed(sine + 3, 7.4, periodic=False)[:7] == pytest.approx(3.0)
    slow = limited(sine, 0.04)
    assert np.abs(np.diff(slow)).max() <= 0.04 + 1e-12
    np.testing.assert_array_equal(limited(sine, 0.07), sine)


EFFECTS = {
    "drive_lag": lambda: plays(behind([1.0], [0.02, 1.0], DRIVE)),
    "delay": lambda: np.concatenate([np.full(13, LAW[0]), LAW[:-13]]),
    "sensor_lag": lambda: behind([1.0], [0.02, 1.0], LAW),
    "resonance": lambda: behind(
        [(90 * np.pi) ** 2], [1.0, 2 * 0.03 * 90 * np.pi, (90 * np.pi) ** 2], LAW
    ),
}
PARAMETERS = {
    "drive_lag": {"time_constant": 0.02},
    "delay": {"delay": 0.013},
    "sensor_lag": {"corner": corner_of(0.02, 1)},
    "resonance": {"frequency": 45.0, "damping": 0.03},
}


LAGS = {"drive_lag", "sensor_lag", "delay"}


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_of_a_large_part_of_the_stroke_is_named_exactly(effect):
    response = EFFECTS[effect]()
    view = view_of([signal_of(DRIVE, response, NOISE)])
    alike = LAGS if effect in LAGS else {effect}
    assert view.posterior.best.names == (effect,)
    assert sum(p for names, p in view.posterior.sets.items() if names & alike) > 0.95
    for name, value in PARAMETERS[effect].items():
        assert view.shape_of(effect)[name] == pytest.approx(value, rel=0.15)
    assert np.std(view.residual) < 1.1 * NOISE
    assert np.corrcoef(view.effects[effect], response - LAW)[0, 1] > 0.95


def test_two_modes_are_told_from_one():
    one, other = (90 * np.pi) ** 2, (150 * np.pi) ** 2
    first = behind([one], [1.0, 0.06 * 90 * np.pi, one], LAW)
    second = behind([other], [1.0, 0.06 * 150 * np.pi, other], LAW)
    view = view_of([signal_of(DRIVE, 0.7 * first + 0.3 * second, NOISE)])
    assert "second_mode" in view.posterior.best.names
    assert view.posterior.probability_of("resonance") < 0.01
    shape = view.shape_of("second_mode")
    assert shape["frequency"] == pytest.approx(45.0, rel=0.02)
    assert shape["ratio"] == pytest.approx(5 / 3, rel=0.02)
    assert shape["participation"] == pytest.approx(0.3, abs=0.03)
    assert np.std(view.residual) < 1.1 * NOISE


def test_a_mode_of_a_small_part_in_the_motion_is_one_of_two():
    square = (90 * np.pi) ** 2
    ringing = behind([square], [1.0, 0.06 * 90 * np.pi, square], LAW)
    view = view_of([signal_of(DRIVE, 0.9 * LAW + 0.1 * ringing, NOISE)])
    assert view.posterior.best.names == ("second_mode",)
    shape = view.shape_of("second_mode")
    assert shape["frequency"] == pytest.approx(45.0, rel=0.02)
    assert 1 - shape["participation"] == pytest.approx(0.1, abs=0.02)
    assert np.std(view.residual) < 1.1 * NOISE


def test_newtons_method_finds_parameters_from_far():
    signals = [signal_of(DRIVE, EFFECTS["sensor_lag"](), NOISE)]
    start = (Stage("sensor_lag", {"corner": 4.0, "order": 1.0}),)
    like = Line.of(signals, ()).prior.settled(response_of(signals))
    found = fitted(signals, [start], np.zeros((DRIVE.size, 0)), like)
    assert found.line.chain[0].shape["corner"] == pytest.approx(corner_of(0.02, 1), rel=0.02)
    assert found.volume(1.0) < found.volume(0.1) < 0.0


def test_newtons_method_begins_at_the_likeliest_start_and_ends_at_the_mode():
    """Curves spend less behind a low mode, so that the gradient of χ² alone points away from it."""
    mode = kernels.mode(25.0, 0.03, STEP)
    law = plays(FALLING)
    rung = law + kernels.Convolution(law, STEP, periodic=False).with_departure(mode)
    signals = [signal_of(FALLING, rung, NOISE)]
    like = Line.of(signals, ()).prior.settled(response_of(signals))
    starts = [
        (Stage("resonance", {"frequency": f, "damping": z}),) for f, z in ((70, 0.1), (35, 0.1))
    ]
    fit = fitted(signals, starts, np.zeros((FALLING.size, 0)), like)
    assert fit.line.chain[0].shape["frequency"] == pytest.approx(25.0, rel=0.05)


@pytest.mark.parametrize(
    "stage",
    [
        Stage("resonance", {"frequency": 35.0, "damping": 0.1}),
        Stage("sensor_lag", {"corner": 20.0, "order": 2.0}),
    ],
)
def test_the_gradient_is_that_of_the_adequacy(stage):
    """Also where χ² is least: as far as forward differences of a hundredth go."""
    response = plays(FALLING)
    for one in filters_of(stage.effect, stage.shape, STEP):
        convolution = kernels.Convolution(response, STEP, periodic=False)
        response = response + convolution.with_departure(one)
    signals = [signal_of(FALLING, response, NOISE)]
    response, nothing = response_of(signals), np.zeros((FALLING.size, 0))
    like = Line.of(signals, ()).prior.settled(response)
    free = [(0, name) for name in stage.free]

    def at(one: Stage) -> Settled:
        return Settled(Line.of(signals, (one,)).prior, like.roughness, like.fading)

    settled = at(stage)
    columns, spent = _changes(signals, settled, Line.of(signals, (stage,)), nothing, free)
    _, gradient = _quadratic(settled, response, nothing, columns, spent)
    for (_, name), own in zip(free, gradient, strict=True):
        up, down = (adequacy(at(stage.changed(name, h)), response, nothing) for h in (0.01, -0.01))
        assert own == pytest.approx((up - down) / 0.02, rel=0.2, abs=1.0)


def test_no_chain_is_longer_than_a_hypothesis_may_be():
    """Of three effects a lone mode may still become two, and nothing else follows."""
    chain = (
        Stage("resonance", {"frequency": 40.0, "damping": 0.05}),
        Stage("drive_lag", {"time_constant": 0.004}),
        Stage("slew_rate_limit", {"rate": 0.5 * np.abs(np.diff(DRIVE)).max() / STEP}),
    )
    mode = kernels.mode(55.0, 0.03, STEP)
    rung = LAW + kernels.Convolution(LAW, STEP, periodic=False).with_departure(mode)
    signals = [signal_of(DRIVE, rung, NOISE)]
    line = Line.of(signals, chain)
    fit = Fitted(line, 0.0, np.zeros((4, 4)), np.ones(4))
    proposals = Expansion.about(line, np.zeros(DRIVE.size), fit).proposed()
    assert proposals
    assert {one.effect for p in proposals for start in p.starts for one in start} == {
        "second_mode", "drive_lag", "slew_rate_limit",
    }  # fmt: skip


def test_a_filter_that_is_far_too_slow_is_never_adequate():
    """Newton's method may try any time constant, also one of whose equations no digit is left."""
    signals = [signal_of(DRIVE, LAW, NOISE)]
    beside = np.zeros((DRIVE.size, 0))
    response = response_of(signals)
    plain = adequacy(Line.of(signals, ()).prior.settled(response), response, beside)
    for corner in (1e-3, 1e-5):
        line = Line.of(signals, (Stage("sensor_lag", {"corner": corner, "order": 4.0}),))
        assert adequacy(line.prior.settled(response), response, beside) < plain - 100

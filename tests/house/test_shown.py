"""Every public result is short at the prompt, and has a view for a notebook."""

import inspect

import numpy as np
import pytest

import fracjax as fj
from fracjax._show import Shown
from tests.results import diagnosis_of, small_fit, small_protocol

STEP = 0.01
RATIOS = np.geomspace(1, 100, 20), np.linspace(1.0, 0.9, 20)


@pytest.fixture(scope="module")
def shown() -> dict[str, object]:
    """One of each public result, with more samples than fit on a screen."""
    fit = small_fit()
    recording = fit.preparation.takes[0].recording
    posterior = fj.sample_posterior(fit, noise_model=fj.WhiteNoise(), steps=40)
    table = fj.frequency_table(RATIOS[0], RATIOS[1], np.linspace(-1, -5, 20))
    frequency_fit = fj.fit_frequency_response("lfdh", table, starts=1)
    trajectory = fj.Trajectory(recording.response - recording.response[0], STEP, "um")
    tones = 50 + 40 * np.sin(2 * np.pi * 2 * STEP * np.arange(400))
    lines = np.cos(np.pi * np.outer([3, 5], np.arange(400)) / 50 + [[3], [5]]).sum(axis=0)
    linear = fj.parse_model("creep")
    results = [
        fit,
        recording,
        posterior,
        posterior.predict(recording),
        diagnosis_of(fit),
        small_protocol(),
        fj.compare(["gain", "creep"], recording, starts=1),
        fj.profile(fit, "alpha"),
        fj.analyse_residuals(fit)[0],
        table,
        frequency_fit,
        fj.tfocim(*RATIOS),
        fj.amplitude_ratios(fj.Recording(tones, 0.1 * tones, STEP)),
        fj.best_linear_approximations(fj.Recording(lines, 0.1 * lines, STEP))[0],
        fj.crosscheck("creep", recording, starts=1, population=8, iterations=5),
        trajectory,
        fj.compensate("gain", trajectory),
        (inverse := fj.streaming_inverse(linear, STEP, (0.1, 2.0), limits=(0, 100))),
        inverse.promise(),
        fj.streaming_model(fit, STEP),
        fj.Adaptation(),
        fj.simulate("foh", recording),
        fj.fit("creep", recording, starts=1).to_scipy(),
        fj.parse_model("foh >> second_mode >> minor_loop_memory"),
        fit.noise,
        fit.estimates[0],
    ]  # fmt: skip
    return {type(result).__name__: result for result in results}


def test_each_is_short_at_the_prompt(shown):
    too_long = {
        name: len(lines)
        for name, result in shown.items()
        if len(lines := repr(result).splitlines()) >= 20
    }
    assert not too_long


def test_there_is_one_of_each(shown):
    public = {name: getattr(fj, name) for name in fj.__all__}
    results = {
        name
        for name, it in public.items()
        if inspect.isclass(it) and (issubclass(it, Shown) or hasattr(it, "_fields"))
    }
    assert results - shown.keys() == set()


def test_each_result_has_a_view_for_a_notebook(shown):
    for result in shown.values():
        if isinstance(result, Shown) or hasattr(result, "_fields"):
            assert result._repr_html_().startswith("<div>")

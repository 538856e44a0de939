"""What a posterior shows of itself."""

import numpy as np
import pytest

import fracjax as fj


def test_a_posterior_is_short_at_the_prompt_and_complete_in_its_summary(sampled):
    text = repr(sampled)
    assert len(text.splitlines()) < 20
    assert text.startswith("law with white noise")
    for row in sampled.rows:
        assert row.name in text
    assert "R-hat" in sampled.summary()
    assert "<table>" in sampled._repr_html_()


def test_the_draws_are_a_table(sampled):
    table = sampled.to_dataframe()
    walkers, draws = sampled.log_posterior.shape
    assert len(table) == walkers * draws
    assert table.loc[(1, 2), "a"] == sampled.samples["a"][1, 2]


def test_pictures(sampled):
    count = len(sampled.rows)
    assert len(sampled.plot_corner().axes) == count**2
    trace = sampled.plot_trace()
    assert len(trace.axes) == count
    walkers, draws = sampled.log_posterior.shape
    assert len(trace.axes[0].lines) == walkers + 1
    assert trace.axes[0].lines[0].get_xdata().size == draws
    assert sampled.plot_prior().axes
    measured = sampled.bands[0].response
    assert any(np.array_equal(line.get_ydata(), measured) for line in sampled.plot().axes[0].lines)
    assert len(sampled.plot_loop().axes) == 2
    assert len(sampled.plot_residuals().axes) == 4
    with pytest.raises(fj.InputError, match="recording: expected a number from 0 to 0, found 2"):
        sampled.plot(2)

"""A posterior beside its closed form; saved, loaded, shown, refused."""

import json
import re
from dataclasses import replace

import arviz
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._posterior import Logarithmic, Normal, Row, laplace, target_of
from fracjax._posterior._posterior import _starts
from tests.posterior.helpers import DRIVE, SHARP, by_name


def test_a_linear_model_has_the_posterior_in_closed_form(cubic, sampled):
    target, _ = target_of(cubic, fj.WhiteNoise(), SHARP)
    prior_sd = np.array([float(prior.sd) for prior in target.priors[:2]])  # type: ignore[attr-defined]
    columns = np.stack([DRIVE, DRIVE**3], axis=1)
    columns -= columns.mean(axis=0)
    response = cubic.preparation.takes[0].recording.response
    precision = columns.T @ columns / 0.05**2 + np.diag(prior_sd**-2.0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ columns.T @ (response - response.mean()) / 0.05**2
    sd = np.sqrt(np.diag(covariance))
    assert sampled.converged
    for k, name in enumerate("ab"):
        row = by_name(sampled)[name]
        assert abs(row.mean - mean[k]) < 0.05 * sd[k], name
        assert row.sd == pytest.approx(sd[k], rel=0.05)
        assert row.laplace_mean == pytest.approx(mean[k], abs=1e-4 * sd[k])
        assert row.laplace_sd == pytest.approx(sd[k], rel=1e-4)
        assert row.interval == pytest.approx(
            (mean[k] - 1.96 * sd[k], mean[k] + 1.96 * sd[k]), abs=0.3 * sd[k]
        )
        assert row.agrees
    assert "agrees" in sampled.sentence


def test_the_predictive_band_holds_what_was_measured(sampled):
    (band,) = sampled.bands
    inside = (band.response > band.predictive[0]) & (band.response < band.predictive[1])
    assert 0.9 < inside.mean() < 0.99
    assert np.all(band.model[0] >= band.predictive[0])
    width = np.mean(band.predictive[1] - band.predictive[0])
    assert width == pytest.approx(2 * 1.96 * 0.05, rel=0.05)


def test_what_is_saved_is_loaded_without_loss(sampled, tmp_path):
    sampled.save(tmp_path)
    loaded = fj.load_posterior(tmp_path)
    assert loaded.to_dict() == sampled.to_dict()
    assert loaded.rows == sampled.rows
    for name, draws in sampled.samples.items():
        np.testing.assert_array_equal(loaded.samples[name], draws)
        np.testing.assert_array_equal(loaded.prior[name], sampled.prior[name])
    for one, other in zip(loaded.bands, sampled.bands, strict=True):
        for field in ("times", "drive", "response", "used", "median", "model", "predictive"):
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
    told = json.loads((tmp_path / "posterior.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.posterior/1"
    assert told["parameters"]["a"]["unit"] == "um/V"


def test_arviz_reads_it(sampled, tmp_path):
    sampled.save(tmp_path)
    groups = arviz.from_netcdf(str(tmp_path / "posterior.nc"))
    found = groups["posterior"]["a"]
    assert found.dims == ("chain", "draw")
    assert found.attrs["units"] == "um/V"
    assert np.asarray(found).mean() == pytest.approx(by_name(sampled)["a"].mean, rel=1e-12)
    groups.close()  # type: ignore[call-arg]


@pytest.mark.parametrize("content", [None, "", "{}", '{"schema": "fracjax.posterior/99"}'])
def test_what_is_no_posterior_is_refused(content, sampled, tmp_path):
    sampled.save(tmp_path)
    if content is None:
        (tmp_path / "posterior.nc").unlink()
    else:
        (tmp_path / "posterior.json").write_text(content, encoding="utf-8")
    with pytest.raises(fj.InputError, match=r"expected a (folder|posterior).*found"):
        fj.load_posterior(tmp_path)


def test_the_page_shows_it_all(sampled, tmp_path):
    fj.write_report(sampled, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 5
    for text in (
        "noise.sigma",
        "not modelled",
        "Prior and posterior",
        "Traces",
        "split R-hat",
        sampled.sentence,
    ):
        assert text in page
    assert not re.search(r'(src|href)="(?!data:|#)', page.replace("xlink:href", "href"))


def test_precision_is_left_alone(cubic, sampled, float32_default):
    again = fj.sample_posterior(cubic, noise_model=fj.WhiteNoise(), priors=SHARP, steps=200)
    assert jnp.ones(1).dtype == np.float32
    assert again.samples["a"].dtype == np.float64
    assert by_name(again)["a"].laplace_sd == pytest.approx(by_name(sampled)["a"].laplace_sd)


# Laplace ------------------------------------------------------------------------------------------


def test_where_the_data_tell_nothing_the_prior_stands(cubic):
    """Noise a million times the signal."""
    priors = {"noise.sigma": Logarithmic(Normal(np.log(5e4), 1e-9))}
    target, terms = target_of(cubic, fj.WhiteNoise(), priors)
    found = laplace(target, _starts(terms))
    assert found.converged
    np.testing.assert_allclose(found.factor @ found.factor.T, np.eye(3), atol=1e-2)


def test_disagreement_has_limits():
    row = Row("a", "1", 0.0, 1.0, (-2, 2), 900.0, 1.0, 0.0, 1.0, (-9, 9))
    assert row.agrees
    assert not replace(row, mean=0.51).agrees
    assert not replace(row, sd=1.26).agrees
    assert not replace(row, sd=0.79).agrees


# Calls --------------------------------------------------------------------------------------------


def test_unusable_calls_are_refused(cubic):
    with pytest.raises(fj.InputError, match=r'prior of "wumpus": expected one of a, b, noise'):
        fj.sample_posterior(cubic, priors={"wumpus": Normal(0.0, 1.0)})
    for walkers in (4, 33):
        with pytest.raises(fj.InputError, match=r"walkers: expected an even number of at least 6"):
            fj.sample_posterior(cubic, walkers=walkers)
    with pytest.raises(fj.InputError, match=r"steps: expected at least 40, found 3"):
        fj.sample_posterior(cubic, steps=3)

"""Compressed problems: beside the full model, in searches and in posteriors."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import Saturation
from fracjax._crosscheck._box import cost_and_gradient
from fracjax._parameters import named_parameters, set_values
from fracjax._posterior import Normal, compressed, log_posteriors_of, target_of
from fracjax._posterior._posterior import _starts
from fracjax._prepare import layout_of, prepare
from fracjax._prepare._keywords import apply_options
from fracjax._prepare._layout import with_gains, with_shapes_at
from fracjax._prepare._problem import AbstractProblem, Problem
from fracjax._solve import _interpolation, compress
from fracjax._solve import _solve as fitting
from fracjax._solve._chains import chains_of, transfer
from fracjax._solve._compressed import columns_at
from fracjax._solve._interpolation import (
    ChebyshevSeries,
    Interpolation,
    _greedy,
    choose_shapes,
)
from fracjax._solve._least_squares import Objective
from fracjax._solve._search import search
from fracjax._solve._solve import fit_block, solve_from, starts_of
from fracjax._solve._span import ChainSignals
from fracjax._solve._transformed import Transformed

STEP = 2e-3
SAMPLES = 700
TIMES = STEP * np.arange(SAMPLES)
WHITE = np.ones(1)
COLOURED = np.array([1.0, -0.9, 0.2])

LAWS = {
    "foh": {"alpha": 0.14, "beta": -0.13, "k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-4},
    "lfdh": {"chi": 0.2, "mu": 0.4, "delta": 0.08, "k_0": 0.03, "k_delta": 0.12},
    "creep": {"k_c": 0.1, "mu": 0.02},
    "coupled": {"first.alpha": 0.2, "first.k_l": 0.07, "first.k_h": 0.04, "first.k_p": 1.5e-4},
    "pea_dynamics": {"gain": 0.1, "creep_gain": 0.02, "frequency": 900.0},
}
# A mode is compressed where it lies well above what the drive holds.
ABOVE = {"frequency": (400.0, 4000.0), "mu": (-0.5, 0.5), "damping": (0.01, 0.5)}

DRIVES = {
    "tones": 40 + 15 * np.sin(2 * np.pi * 2.3 * TIMES) + 9 * np.sin(2 * np.pi * 9.1 * TIMES + 1),
    "triangle": 50 + 80 / np.pi * np.arcsin(np.sin(2 * np.pi * TIMES / 0.28)),
    "steps": np.where(TIMES % 0.7 < 0.35, 20.0, 70.0),
}


def model_of(name: str) -> fj.Model:
    model = fj.parse_model(name).with_values(LAWS[name])
    bounds = ABOVE if name == "pea_dynamics" else {}
    return fj.Model(apply_options(model, fixed={}, bounds=bounds)[0])


def recording_of(model: fj.Model, drive: np.ndarray, seed: int = 0) -> tuple:
    """A recording and its noise, a thousandth of the response."""
    clean = np.asarray(model.block(jnp.asarray(drive), fj.Grid(STEP)))
    sigma = 1e-3 * float(np.ptp(clean))
    noise = sigma * np.random.default_rng(seed).standard_normal(drive.size)
    return fj.Recording(drive, clean + 1 + noise, STEP), sigma


def prepared(model: fj.Model, drives: list[np.ndarray], filter_=WHITE, **options):
    made = [recording_of(model, drive, seed) for seed, drive in enumerate(drives)]
    sigma = made[0][1]
    noise = fj.Noise(sigma, "um", "specification", filter_, sigma)
    return prepare([r for r, _ in made], noise=noise, **options)


def beside_own(white: np.ndarray, own: np.ndarray) -> np.ndarray:
    """What is left of signals (L, K) beside the recording's own terms."""
    basis, _ = np.linalg.qr(own)
    return white - basis @ (basis.T @ white)


def inner_products(problems: tuple[AbstractProblem, ...], blocks: list) -> np.ndarray:
    """Of the whitened responses of blocks, and the recordings', beside the own terms: (K, K)."""
    found = np.zeros((len(blocks) + 1, len(blocks) + 1))
    for problem in problems:
        signals = [*(np.asarray(problem.simulate(block)) for block in blocks), problem.response]
        white = np.asarray(problem.whiten(np.stack(signals, axis=1)))
        left = beside_own(white, np.asarray(problem.whiten(np.asarray(problem.own))))
        found += left.T @ left
    return found


def drawn(model: fj.Model, problems: tuple[Problem, ...], count: int) -> list:
    """Blocks anywhere within bounds, their gains at their best."""
    size = sum(size for _, size in layout_of(model.block).shapes)
    generator = np.random.default_rng(7)
    objective = Objective(model.block, problems)
    return [objective.at(generator.uniform(size=size)).blocks[0] for _ in range(count)]


CASES = [
    (name, drive, history)
    for name in LAWS
    for drive, history in (("tones", "constant"), ("steps", "rest"), ("triangle", "periodic"))
    if name != "pea_dynamics" or drive == "tones"
]


@pytest.mark.parametrize(("name", "drive", "history"), CASES)
def test_responses_are_those_of_the_full_model(name: str, drive: str, history):
    """All inner products of whitened responses and recording, at fresh shapes."""
    model = model_of(name)
    preparation = prepared(model, [DRIVES[drive]], COLOURED, history=history, settling=None)
    problems = preparation.problems()
    found = compress(model.block, problems)
    assert found is not None
    assert found.error < 0.01
    blocks = drawn(model, problems, 4)
    full = inner_products(problems, blocks)
    sizes = np.sqrt(np.diag(full))
    error = inner_products(found.problems, blocks) - full
    # An error of e in each of two signals changes their product by e times their sizes.
    assert np.all(np.abs(error) < 0.01 * (sizes[:, None] + sizes))
    assert found.problems[0].response.size < 200


def test_an_error_that_is_too_large_is_found():
    """A lightly damped mode rings at every jump: eighty points do not resolve it."""
    model = model_of("pea_dynamics")
    problems = prepared(model, [DRIVES["triangle"]], history="periodic").problems()
    found = compress(model.block, problems)
    assert found is not None
    assert not found.is_accurate_for(1.0)
    assert search(starts_of(model.block, 4, 0), problems) is None


def test_an_error_is_the_same_in_any_unit():
    """In noise standard deviations, of the response at its best gains."""
    model, errors = model_of("creep"), []
    recording, sigma = recording_of(model, DRIVES["tones"])
    for unit in (1.0, 2.0**-10):
        noise = fj.Noise(unit * sigma, "um", "specification", WHITE, unit * sigma)
        scaled = replace(recording, response=unit * recording.response)
        compact = compress(model.block, prepare([scaled], noise=noise).problems())
        assert compact is not None
        errors.append(compact.error)
    assert errors[1] == pytest.approx(errors[0], rel=1e-3)


@pytest.mark.parametrize("name", ["foh", "coupled"])
def test_recordings_are_compressed_together(name: str):
    """Two of one drive, whose signals they share, and one of another with samples left out and an
    unknown past, on a grid four times finer."""
    model = model_of(name)
    drives = [DRIVES["tones"], DRIVES["tones"], 0.8 * DRIVES["tones"][200:] + 10]
    preparation = prepared(model, drives, COLOURED, history="estimated", settling=5)
    last = preparation.takes[2]
    preparation = replace(
        preparation,
        takes=(*preparation.takes[:2], replace(last, used=last.used & (np.arange(500) % 90 > 9))),
    )
    problems = preparation.problems(4)
    found = compress(model.block, problems)
    assert found is not None
    assert found.is_accurate_for(1.0)
    first, second, third = found.problems
    assert first.parts[0].before is second.parts[0].before
    assert first.parts[0].before is not third.parts[0].before
    blocks = drawn(model, problems, 3)
    full = inner_products(problems, blocks)
    sizes = np.sqrt(np.diag(full))
    error = inner_products(found.problems, blocks) - full
    assert np.all(np.abs(error) < 0.01 * (sizes[:, None] + sizes))


@pytest.mark.parametrize(
    "text",
    ["bouc_wen", "foh >> lfdh", "foh >> delay", "minor_loop_memory + foh", "drive_lag >> foh"],
)
def test_what_cannot_be_compressed_is_not(text: str):
    """No sum of chains of linear laws, or a second gain in a row, which has no bounds."""
    model = fj.parse_model(text)
    problems = prepared(model_of("foh"), [DRIVES["tones"]]).problems()
    assert compress(model.block, problems) is None
    assert search([model.block] * 4, problems) is None


def test_what_only_looks_like_a_mode_in_band_is_not_compressed():
    """Bounds from a tenth of a hertz to far beyond the sampling rate: too many shapes."""
    block = fj.parse_model("pea_dynamics").block
    problems = prepared(model_of("foh"), [DRIVES["tones"]]).problems()
    assert compress(block, problems) is None


def test_a_term_that_is_fixed_at_nothing_takes_no_signals():
    model = model_of("foh")
    block = apply_options(model, fixed={"k_p": 0.0}, bounds={})[0]
    problems = prepared(model, [DRIVES["tones"]]).problems()
    found = compress(block, problems)
    assert found is not None
    assert found.is_accurate_for(1.0)
    assert found.problems[0].parts[1].matrix.shape[0] == 0


def test_creep_by_the_logarithm_of_time_is_compressed_too():
    """Its symbol is an integral: one value for each frequency and each shape."""
    block = fj.blocks.FOHLinear() >> fj.blocks.LogarithmicCreep()
    found = compress(block, prepared(model_of("foh"), [DRIVES["tones"]]).problems())
    assert found is not None
    assert found.is_accurate_for(1.0)


# Derivatives --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["foh", "lfdh"])
def test_derivatives_are_those_of_differences_and_of_the_full_model(name: str):
    model = model_of(name)
    problems = prepared(model, [DRIVES["tones"]], settling=0).problems()
    found = compress(model.block, problems)
    assert found is not None
    size = sum(size for _, size in layout_of(model.block).shapes)
    position = np.random.default_rng(3).uniform(0.2, 0.8, size)
    block = with_shapes_at(model.block, position)

    def response(place):
        return found.problems[0].simulate(with_shapes_at(block, place))

    slopes = np.asarray(jax.jit(jax.jacfwd(response))(position))
    cost, gradient = cost_and_gradient(block, found.problems, jnp.asarray(position))
    full = Objective(block, problems)
    assert float(cost) == pytest.approx(full.at(position).cost, rel=1e-6)
    step = 1e-4
    for k, away in enumerate(step * np.eye(size)):
        both = position + away, position - away
        high, low = (response(place) for place in both)
        wanted = (high - low) / (2 * step)
        np.testing.assert_allclose(slopes[:, k], wanted, atol=1e-5 * np.abs(wanted).max())
        slope = (full.at(both[0]).cost - full.at(both[1]).cost) / (2 * step)
        assert gradient[k] == pytest.approx(slope, rel=1e-3, abs=1e-4 * np.abs(gradient).max())


@pytest.mark.parametrize("name", ["foh", "lfdh", "coupled"])
def test_numpy_and_jax_simulate_alike(name: str):
    model = model_of(name)
    (problem,) = compress(model.block, prepared(model, [DRIVES["tones"]]).problems()).problems  # type: ignore[union-attr]
    layout = layout_of(model.block)
    position = np.full((1, len(layout.shapes)), 0.4)
    columns = columns_at(model.block, problem, position)[0]
    block = with_shapes_at(model.block, jnp.asarray(position[0]))
    for k, gains in enumerate(np.eye(len(layout.gains) + 1)[:, 1:]):
        wanted = np.asarray(eqx.filter_jit(problem.simulate)(with_gains(block, jnp.asarray(gains))))
        found = columns[k] + (columns[0] if k else 0.0)
        np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max() + 1e-300)


def test_the_greedy_choice_spans_what_it_chose_from():
    rows = np.random.default_rng(0).standard_normal((40, 6)) @ np.eye(6, 30)
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    picked, basis, left = _greedy(rows, 1e-11)
    assert len(picked) == 6
    assert left < 1e-11
    np.testing.assert_allclose(basis @ basis.T, np.eye(6), atol=1e-14)
    np.testing.assert_allclose(rows @ basis.T @ basis, rows, atol=1e-13)


# Searches -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["foh", "lfdh", "creep", "coupled"])
def test_the_search_finds_what_descents_of_the_full_model_find(name: str, monkeypatch):
    model = model_of(name)
    preparation = prepared(model, [DRIVES["tones"]], COLOURED, settling=0)
    starts = starts_of(model.block, 6, 1)
    slow = solve_from(starts, preparation)
    fast = fit_block(model.block, preparation, 6, 1)
    assert fast.cost <= slow.cost + 1e-3
    assert fast.converged
    assert len(fast.start_costs) == 6
    assert min(fast.start_costs) == pytest.approx(fast.cost, rel=1e-6)
    found = search(starts, preparation.problems())
    assert found is not None
    # The full model is asked a few times only.
    assert fast.evaluations - found.evaluations <= 5
    np.testing.assert_allclose(fast.simulations[0], slow.simulations[0], atol=1e-4)


def test_a_bound_is_kept_in_the_search():
    model = model_of("foh")
    block = apply_options(model, fixed={}, bounds={"alpha": (0.3, 0.6)})[0]
    preparation = prepared(model, [DRIVES["tones"]], settling=0)
    starts = starts_of(block, 4, 0)
    found = search(starts, preparation.problems())
    slow = solve_from(starts, preparation)
    assert found is not None
    assert found.cost == pytest.approx(slow.cost, rel=1e-6)
    assert float(found.best.alpha.value) == pytest.approx(0.3, abs=1e-6)  # type: ignore[attr-defined]


def test_where_the_full_model_disagrees_it_is_fitted_from_every_start(monkeypatch):
    model = model_of("creep")
    preparation = prepared(model, [DRIVES["tones"]], settling=0)
    honest = search(starts_of(model.block, 4, 0), preparation.problems())
    assert honest is not None
    wrong = honest._replace(costs=honest.costs / 2)
    monkeypatch.setattr(fitting, "search", lambda blocks, problems: wrong)
    solved = fit_block(model.block, preparation, 4, 0)
    assert solved.cost == pytest.approx(honest.cost, rel=1e-6)
    assert solved.start_costs == solve_from(starts_of(model.block, 4, 0), preparation).start_costs


def test_fewer_samples_than_signals_are_fitted_again_and_again():
    """From the second fit to a drive on its basis is kept, of no more vectors than samples."""
    times = np.arange(40)
    drive = np.sin(2 * np.pi * times / 20) + 0.3 * np.cos(2 * np.pi * times / 10)
    found = []
    for seed in (0, 1, 0):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(40)
        recording = fj.Recording(drive, 0.1 * drive + noise, 0.01)
        found.append(fj.fit("lfdh", recording, history="constant").scores.rmse)
    assert found[2] == pytest.approx(found[0], rel=1e-3)
    assert max(found) < 1.2e-3


def test_few_starts_are_not_worth_it():
    model = model_of("creep")
    problems = prepared(model, [DRIVES["tones"]]).problems()
    assert search([model.block] * 3, problems) is None


# Posteriors ---------------------------------------------------------------------------------------


def fitted(name: str, history) -> fj.Fit:
    model = model_of(name)
    recording, sigma = recording_of(model, DRIVES["tones"])
    noise = fj.Noise(sigma, "um", "repeats", COLOURED, sigma)
    return fj.fit(model, recording, noise=noise, history=history, starts=1, settling=3)


@pytest.mark.parametrize(
    ("name", "history", "noise"),
    [
        ("foh", "constant", fj.WhiteNoise()),
        ("lfdh", "estimated", fj.ARNoise(2)),
        ("creep", "rest", fj.MeasuredNoise()),
    ],
)
def test_densities_are_those_of_the_full_model(name: str, history, noise):
    """Near the fit to a thousandth, and far from it relatively."""
    target, terms = target_of(fitted(name, history), noise, {})
    start = _starts(terms)
    fast = compressed(target, start)
    assert fast is not target
    generator = np.random.default_rng(0)
    away = generator.standard_normal((16, start.size))
    points = np.concatenate([start + 1e-3 * away[:8], away[8:]])
    full, found = (log_posteriors_of(t)(points) for t in (target, fast))
    assert np.all(np.isfinite(full))
    np.testing.assert_allclose(found, full, rtol=1e-7, atol=1e-3)


def test_a_density_that_needs_every_sample_stays_full():
    fit = fitted("creep", "constant")
    target, terms = target_of(fit, fj.StudentNoise(), {})
    assert compressed(target, _starts(terms)) is target


def test_a_prior_that_leaves_the_bounds_stays_full():
    fit = fitted("creep", "constant")
    target, terms = target_of(fit, fj.WhiteNoise(), {"mu": Normal(0.02, 0.1)})
    assert compressed(target, _starts(terms)) is target
    target, terms = target_of(fit, fj.WhiteNoise(), {"mu": Normal(0.02, 1e-3)})
    assert compressed(target, _starts(terms)) is not target


def test_an_error_beyond_the_noise_stays_full():
    """A noise so small that the interpolation's error is seen."""
    fit = fitted("lfdh", "constant")
    target, terms = target_of(fit, fj.WhiteNoise(), {})
    quiet = _starts(terms)
    quiet[-1] = -1e3
    assert compressed(target, quiet) is target


# Coordinates of a law -----------------------------------------------------------------------------


@pytest.mark.parametrize("history", ["constant", "periodic"])
@pytest.mark.parametrize(
    ("law", "kind", "error"),
    [
        (fj.blocks.SingleOperator(), ChebyshevSeries, 1e-9),
        (fj.blocks.FOHLinear(), ChebyshevSeries, 1e-9),
        (fj.blocks.Creep(), ChebyshevSeries, 1e-9),
        (fj.blocks.LFDH(), Interpolation, 1e-3),
    ],
)
def test_coordinates_are_those_of_the_law(law, kind, error, history):
    """At any shape and gain, what the chosen laws' transfer functions combine to is the law's."""
    drive = DRIVES["tones"][:, None]
    grid = fj.Grid(np.asarray(STEP), history)
    chosen = choose_shapes(law, Transformed.of(drive, grid), grid)
    assert chosen is not None
    assert isinstance(chosen.coordinates, kind)
    zeta, weights = Transformed.of(drive, grid).points
    theirs = np.atleast_2d(transfer(chosen.blocks, zeta, grid)).T
    rows = chosen.in_coordinates(np.real(theirs)), chosen.in_coordinates(np.imag(theirs))
    generator = np.random.default_rng(0)
    layout = layout_of(law)
    for share in (0.0, 1.0, *generator.uniform(size=6)):
        place = np.full(len(layout.shapes), share)
        there = with_gains(with_shapes_at(law, place), generator.normal(size=len(layout.gains)))
        values = transfer(there, zeta, grid) * weights
        found = chosen.coordinates(there, grid)
        combined = (rows[0] @ found + 1j * (rows[1] @ found)) * weights
        assert np.linalg.norm(combined - values) < error * np.linalg.norm(values)


def signals_by(shapes, drives: np.ndarray, grid: fj.Grid) -> np.ndarray:
    """The responses (d, n, M) of a block at its chosen shapes to drives (M, d)."""
    chain = ChainSignals(shapes, Transformed.of(drives, grid), None, grid, 1)
    signals = np.empty((drives.shape[1], chain.total, chain.samples))
    for at, of_drive in enumerate(signals):
        chain.fill(at, of_drive)
    return signals


@pytest.mark.parametrize("tables", [1, 3, 7, 11])
def test_responses_are_the_same_whatever_part_of_the_laws_a_table_holds(monkeypatch, tables):
    drive = np.random.default_rng(0).standard_normal((400, 2)).cumsum(axis=0)
    grid = fj.Grid(np.asarray(STEP), "constant")
    chosen = choose_shapes(fj.blocks.LFDH(), Transformed.of(drive, grid), grid)
    assert chosen is not None
    whole = signals_by(chosen, drive, grid)
    size = Transformed.of(drive, grid).zeta.size
    monkeypatch.setattr(_interpolation, "_LARGEST_TABLE", tables * size)
    np.testing.assert_array_equal(signals_by(chosen, drive, grid), whole)


@pytest.mark.parametrize("tables", [5, 1000])
def test_sums_of_signals_are_those_of_the_signals(monkeypatch, tables):
    """Of a block and of what follows it, for some of the drives, whatever a table holds."""
    drives = np.random.default_rng(0).standard_normal((400, 3)).cumsum(axis=0)
    grid = fj.Grid(np.asarray(STEP), "constant")
    transformed = Transformed.of(drives, grid)
    shapes = choose_shapes(fj.blocks.LFDH(), transformed, grid)
    assert shapes is not None
    inputs = shapes.size
    between = Transformed.of(signals_by(shapes, drives, grid).reshape(-1, 400).T, grid)
    monkeypatch.setattr(_interpolation, "_LARGEST_TABLE", tables * transformed.zeta.size)
    factors = np.random.default_rng(1).uniform(1, 2, (3, 200))
    chain = ChainSignals(shapes, between, factors, grid, 2, inputs)
    signals = np.empty((3, chain.total, 200))
    for at, of_drive in enumerate(signals):
        chain.fill(at, of_drive)
    mixing = np.random.default_rng(2).standard_normal((2, 4, chain.total))
    mixing[:, 1] = 0.0
    wanted = mixing @ signals[1:]
    mixed = chain.mix(np.array([1, 2]), mixing)
    np.testing.assert_allclose(mixed, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize("samples", [399, 400])
def test_responses_of_the_chosen_laws_are_those_of_the_laws(samples, history):
    """For an even and an odd number of samples, of which a cycle has another highest line."""
    turns = 2 * np.pi * np.arange(samples) / samples
    highest = np.cos(samples // 2 * turns)
    drive = (40 + 20 * np.sin(3 * turns) + 5 * np.cos(70 * turns) + 2 * highest)[:, None]
    drive = drive - drive.mean() if history == "periodic" else drive
    grid = fj.Grid(np.asarray(STEP), history)
    law = fj.blocks.LFDH()
    chosen = choose_shapes(law, Transformed.of(drive, grid), grid)
    assert chosen is not None
    found = signals_by(chosen, drive, grid)[0].T
    values = {n: np.ravel(p.value) for n, p in named_parameters(chosen.blocks).items()}
    for k in (0, found.shape[1] // 2, found.shape[1] - 1):
        one = set_values(law, {name: v[k % v.size] for name, v in values.items()})
        wanted = np.asarray(one(jnp.asarray(drive[:, 0]), grid))
        if history == "constant":  # what the held value adds is left out
            wanted = wanted - wanted[0]
        np.testing.assert_allclose(found[:, k], wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())


def test_a_law_that_is_not_linear_breaks_a_chain_wherever_it_stands():
    foh, creep = (fj.parse_model(name).block for name in ("foh", "creep"))
    limit = Saturation(80.0, low=0.0, high=100.0)
    assert chains_of(foh >> (creep >> creep)) is not None
    assert chains_of(foh >> (creep >> limit)) is None
    assert chains_of(foh >> (limit >> creep)) is None

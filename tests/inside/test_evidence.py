"""The posterior's probabilities against integrals and covariances that NumPy computes directly."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import null_space

from fracjax._inside import Candidate, Inside
from fracjax._inside._columns import Column, Columns
from fracjax._inside._posterior import About, Worth

SAMPLES, SIZE = 90, 10.0
LAWS = (0.0, 0.003, 0.03, 0.3)
SIZES = (0.03, 0.1, 0.3, 1.0, 3.0)
RNG = np.random.default_rng(21)
TANGENT = RNG.standard_normal((SAMPLES, 3))
SHAPES = {  # of each effect, its columns
    "drag": [0.3 * RNG.standard_normal((SAMPLES, 1)) for _ in range(2)],  # of one sign
    "spring": [RNG.standard_normal((SAMPLES, 1))],
    "stores": [0.2 * RNG.standard_normal((SAMPLES, 2)) for _ in range(2)],
}
OTHERS = {
    "drive_curve": [RNG.standard_normal((SAMPLES, 2))],
    "linear_dynamics": [RNG.standard_normal((SAMPLES, 2)) for _ in range(2)],
}
RESIDUAL = 0.6 * RNG.standard_normal(SAMPLES) + sum(s[0][:, 0] for s in SHAPES.values()) / 4
WORTHS = {"plain": Worth(1.0, SAMPLES), "thinned": Worth(2.5, 30.0)}


def about(residual: np.ndarray = RESIDUAL) -> About:
    effects = {name: [Column((), s) for s in shapes] for name, shapes in SHAPES.items()}
    others = {name: [Column((), s) for s in shapes] for name, shapes in OTHERS.items()}
    return About.of(Columns(effects, others, residual, TANGENT, SIZE), frozenset({"drag"}))


ABOUT = about()
FREE = null_space(TANGENT.T)
"""(SAMPLES, k) directions that the tangent does not reach."""


def beyond(signals: np.ndarray, worth: Worth) -> np.ndarray:
    """What the tangent leaves of signals, thinned to what they are worth."""
    return FREE.T @ signals * np.sqrt(worth.samples / SAMPLES / worth.variance)


def nuisance(worth: Worth) -> np.ndarray:
    """What is no effect, each of the response's norm."""
    columns = np.concatenate([s for shapes in OTHERS.values() for s in shapes], axis=1)
    return beyond(SIZE * columns / np.linalg.norm(columns, axis=0), worth)


def covariance(law: float, worth: Worth, *more: tuple[float, np.ndarray]) -> np.ndarray:
    """1 + N_τ N_τᵀ + Σ s² D Dᵀ beyond the tangent."""
    parts = [(law, nuisance(worth)), *((s, beyond(d, worth)) for s, d in more)]
    return np.eye(FREE.shape[1]) + sum(s**2 * d @ d.T for s, d in parts)


def chi_square(residual: np.ndarray, matrix: np.ndarray) -> float:
    return float(residual @ np.linalg.solve(matrix, residual))


def log_density(matrix: np.ndarray, worth: Worth) -> float:
    """Of the residual, up to a constant; what nothing explains counts as noise."""
    square = chi_square(beyond(RESIDUAL, worth), matrix)
    excess = max(1.0, square / worth.samples)
    determinant = np.linalg.slogdet(matrix)[1]
    return -0.5 * (worth.samples * np.log(excess) + square / excess + determinant)


def log_mean(values) -> float:
    return float(np.log(np.mean(np.exp(values))))


@pytest.mark.parametrize("worth", WORTHS.values(), ids=WORTHS)
@pytest.mark.parametrize("law", LAWS)
def test_an_effect_of_two_signs_has_the_evidence_of_its_covariance(law, worth):
    """Averaged over its shapes and sizes, with a fiftieth of prior odds."""
    hypotheses = {h.names: h for h in ABOUT.posterior(worth).hypotheses if h.law == str(law)}
    nothing = log_density(covariance(law, worth), worth)
    assert hypotheses[()].log_posterior == pytest.approx(nothing)
    for name in ("spring", "stores"):
        values = [
            log_density(covariance(law, worth, (s, shape)), worth)
            for shape in SHAPES[name]
            for s in SIZES
        ]
        wanted = np.log(0.02) + log_mean(values)
        assert hypotheses[(name,)].log_posterior == pytest.approx(wanted)
        # The most likely shape and size are named.
        which, size = divmod(int(np.argmax(values)), len(SIZES))
        own = [k for k, kind in enumerate(ABOUT.kinds) if kind.name == name]
        assert hypotheses[(name,)].kinds == (own[which],)
        assert hypotheses[(name,)].sizes == (SIZES[size],)


@pytest.mark.parametrize("law", LAWS)
def test_an_effect_of_one_sign_is_an_integral_over_positive_sizes(law):
    worth = WORTHS["plain"]
    residual, matrix = beyond(RESIDUAL, worth), covariance(law, worth)
    constant = -0.5 * np.linalg.slogdet(matrix)[1]
    values = []
    for shape in SHAPES["drag"]:
        column = beyond(shape[:, 0], worth)
        weighted = np.linalg.solve(matrix, np.column_stack([column, residual]))
        a, b, c = column @ weighted[:, 0], column @ weighted[:, 1], residual @ weighted[:, 1]
        for s in SIZES:

            def density(x: float, s=s, a=a, b=b, c=c) -> float:
                prior = 2 * np.exp(-0.5 * (x / s) ** 2) / (s * np.sqrt(2 * np.pi))
                return prior * np.exp(-0.5 * (c - 2 * x * b + x * x * a))

            values.append(constant + np.log(quad(density, 0, 10 * s, points=[0.3 * s, s])[0]))
    every = ABOUT.posterior(worth).hypotheses
    (one,) = (h for h in every if (h.law, h.names) == (str(law), ("drag",)))
    assert one.log_posterior == pytest.approx(np.log(0.02) + log_mean(values), abs=1e-6)


@pytest.mark.parametrize("worth", WORTHS.values(), ids=WORTHS)
def test_the_posterior_is_over_all_laws_and_sets(worth):
    posterior = ABOUT.posterior(worth)
    logs = np.array([h.log_posterior for h in posterior.hypotheses])
    assert [*logs] == sorted(logs, reverse=True)
    assert {h.law for h in posterior.hypotheses} == {*map(str, LAWS)}
    weights = np.exp(logs - logs.max())
    empty = [h.names == () for h in posterior.hypotheses]
    assert posterior.nothing == pytest.approx(weights[empty].sum() / weights.sum())
    assert len(posterior.sets) == 8  # of three effects


@pytest.mark.parametrize("worth", WORTHS.values(), ids=WORTHS)
def test_coefficients_and_what_remains_are_those_of_their_own_law_and_prior(worth):
    """For every law, set, shape and size; a small prior size draws a coefficient to 0."""
    for one in ABOUT.posterior(worth).hypotheses:
        chosen = [ABOUT.shapes[k].white for k in one.kinds]
        every = [*zip(one.sizes, chosen, strict=True)]
        matrix = covariance(float(one.law), worth, *every)
        inverse = np.linalg.solve(matrix, beyond(RESIDUAL, worth))
        left_over = chi_square(beyond(RESIDUAL, worth), matrix)
        wanted = left_over * worth.variance * SAMPLES / worth.samples
        assert ABOUT.remainder(one, worth) == pytest.approx(wanted)
        if chosen:
            coefficients = ABOUT.coefficients(one, worth)
            for (size, shape), values in zip(every, coefficients, strict=True):
                # The mean of a coefficient is its prior's covariance with the residual.
                np.testing.assert_allclose(values, size**2 * beyond(shape, worth).T @ inverse)


@pytest.mark.parametrize("worth", WORTHS.values(), ids=WORTHS)
@pytest.mark.parametrize("effects", [0, 1, 3])
def test_a_fits_evidence_is_its_covariances_and_pays_for_its_freedom(worth, effects):
    values = [log_density(covariance(law, worth), worth) for law in LAWS]
    freedom = 0.5 * 3 * np.log(1 + worth.samples)
    total, size = ABOUT.evidence(worth, effects)
    assert total == pytest.approx(log_mean(values) - freedom + effects * np.log(0.02))
    assert size == LAWS[int(np.argmax(values))]


def test_what_is_outside_explains_most_with_the_least_freedom():
    answers = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        variance = 10 ** rng.uniform(-2, 1)
        several = OTHERS["linear_dynamics"][0][:, 0] * rng.normal() + rng.standard_normal(SAMPLES)
        residual = several + OTHERS["drive_curve"][0][:, 0] * rng.normal()
        values = {}
        for name, shapes in OTHERS.items():
            columns = np.concatenate(shapes, axis=1)
            columns = FREE.T @ (SIZE * columns / np.linalg.norm(columns, axis=0))
            matrix = np.eye(FREE.shape[1]) + 0.3**2 * columns @ columns.T
            determinant = np.linalg.slogdet(matrix)[1]
            values[name] = chi_square(FREE.T @ residual, matrix) / variance + determinant
        answers.append(about(residual).outside(Worth(variance, SAMPLES)))
        assert answers[-1] == min(values, key=values.__getitem__)
    assert {*answers} == {*OTHERS}


def test_columns_that_overflow_or_vanish_count_for_nothing():
    broken = np.full((SAMPLES, 1), np.nan)
    effects = {"spring": [Column((), SHAPES["spring"][0]), Column((), broken)]}
    others = {"drive_curve": [Column((), np.zeros((SAMPLES, 1)))]}
    residual = np.where(np.arange(SAMPLES) < 80, RESIDUAL, 0.0)
    one = About.of(Columns(effects, others, residual, TANGENT, SIZE), frozenset())
    assert np.all(np.isfinite(one.inner.columns))
    np.testing.assert_array_equal(one.inner.columns[[0, 2]], 0.0)
    assert [(kind.name, kind.start, kind.stop) for kind in one.kinds] == [
        ("spring", 1, 2), ("spring", 2, 3)
    ]  # fmt: skip
    assert one.samples == 80  # a residual that does not count is 0
    assert one.inner.log_determinant == 0.0


@pytest.mark.parametrize(
    ("least", "specified", "variance", "misfit"),
    [
        (50.0, True, 1.0, 0.0),
        (100.0, True, 1.0, 0.0),
        (400.0, True, 4.0, 0.75),
        (50.0, False, 0.5, 1.0),
        (400.0, False, 4.0, 1.0),
    ],
)
def test_a_residual_is_worth_less_by_what_is_never_known_and_by_its_misfit(
    least, specified, variance, misfit
):
    worth = Worth.of(least, 100, specified=specified)
    assert worth.variance == variance
    assert worth.samples == pytest.approx(100 / (1 + (0.002 + misfit / 50) * 100))


def inside(*sets: tuple[tuple[str, ...], float, float]) -> Inside:
    """A result of candidates: names, ratio, probability."""
    block: object = None
    candidates = tuple(Candidate(names, block, ratio, p) for names, ratio, p in sets)  # type: ignore[arg-type]
    return Inside(block, block, candidates, "", None, None)  # type: ignore[arg-type]


def test_an_effects_share_is_what_its_set_leaves_less_than_the_best_without_it():
    one = inside(
        (("clearance", "end_stop"), 0.1, 0.6),
        (("end_stop",), 0.3, 0.2),
        (("diode", "end_stop"), 0.15, 0.1),
        (("clearance",), 0.8, 0.05),
        ((), 1.0, 0.05),
    )
    # Only sets within the best are compared.
    assert one.share_of("clearance") == pytest.approx(0.2)
    assert one.share_of("end_stop") == pytest.approx(0.7)
    assert inside((("clearance",), 0.1, 1.0)).share_of("clearance") == pytest.approx(0.9)
    assert one.names == ("end_stop", "clearance")
    assert one.probability_of("diode") == pytest.approx(0.1)
    assert inside((("diode",), 0.1, 0.7), (("diode",), 0.1, 0.7)).probability_of("diode") == 1.0


def test_what_may_stand_in_an_effects_place_is_a_twentieth_as_probable():
    one = inside(
        (("a", "b"), 0.1, 0.5),
        (("b", "c"), 0.1, 0.025),
        (("b", "d"), 0.1, 0.0249),
        (("b",), 0.1, 0.3),
        (("b", "c", "d"), 0.1, 0.1),
        (("a", "b", "b"), 0.1, 0.02),
        (("e", "f"), 0.1, 0.03),
    )
    assert one.sets == (("b",), ("a", "c"))
    assert inside((("a",), 0.1, 0.5), (("a", "a"), 0.1, 0.4)).sets == (("a",),)

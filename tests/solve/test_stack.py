"""Recordings solved together, compared with each on its full model."""

from dataclasses import replace

import numpy as np
import pytest

import fracjax as fj
from fracjax._computing import computing
from fracjax._prepare import HistoryOption, Preparation, layout_of, prepare, with_shapes_at
from fracjax._prepare._keywords import apply_options
from fracjax._solve import Solved, _by_signals, compress, fit_blocks, simulate, solve_from
from fracjax._solve._direct import Direct, thinned
from fracjax._solve._least_squares import Objective
from fracjax._solve._lockstep import Stack, dependences, evaluate
from fracjax._solve._signals import signals_of
from fracjax._solve._stack import Row, _groups, can_stack, is_alone, respond_rows, solve_rows

STEP, SAMPLES = 2e-3, 600
SHAPES = {
    "foh": {"k_l": 0.07, "k_h": 0.04, "k_p": 2e-4, "alpha": 0.2, "beta": -0.15},
    "creep": {"k_c": 0.1, "mu": 0.02},
    "lfdh": {"k_0": 0.05, "k_delta": 0.1, "chi": 0.3, "delta": 0.1, "mu": 0.45},
    "pea_dynamics": {
        "gain": 0.07, "creep_gain": 0.02, "mu": -0.2, "frequency": 25.0, "damping": 0.3
    },
    "coupled": {
        "foh.k_l": 0.07, "foh.k_h": 0.04, "foh.k_p": 2e-4, "foh.alpha": 0.2, "foh.beta": -0.15,
        "creep.mu": 0.02,
    },
}  # fmt: skip


def preparations(
    model: fj.Model, own: bool, history: HistoryOption = "constant"
) -> list[Preparation]:
    """Five recordings, each with a drive of its own or all with one, the last in coloured noise."""
    times, prepared = STEP * np.arange(SAMPLES), []
    for k in range(5):
        generator = np.random.default_rng(k)
        phases = np.random.default_rng(k if own else 0).uniform(0, 6, 3)
        drive = 40 + np.sin(2 * np.pi * np.outer(times, [1.7, 5.3, 11.9]) + phases) @ [14, 8, 5]
        with computing():
            response = model.block.respond(drive, fj.Grid(np.asarray(STEP), "constant"))
        white = 1e-3 * np.ptp(response) * generator.standard_normal(SAMPLES)
        level = float(white.std())
        filter_ = np.array([1.0, -0.6]) if k == 4 else np.ones(1)
        noise = fj.Noise(level, "um", "repeats", filter_, level)
        if k == 4:
            for t in range(1, SAMPLES):
                white[t] += 0.6 * white[t - 1]
        recording = fj.Recording(drive, response + white, STEP, source=f"{k}")
        prepared.append(prepare([recording], noise=noise, history=history))
    return prepared


@pytest.mark.parametrize("own", [True, False], ids=["own drives", "one drive"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_stack_ends_where_each_full_model_does(name, own):
    model = fj.parse_model(name).with_values(SHAPES[name])
    with computing():
        prepared = preparations(model, own)
        together = fit_blocks([model.block] * 5, prepared, 4, 0)
        alone = [solve_from([each.block], p) for each, p in zip(together, prepared, strict=True)]
        afresh = [solve_from([model.block], p) for p in prepared]
        for each, full, other, p in zip(together, alone, afresh, prepared, strict=True):
            assert each.stacked
            # The stack's responses are those of its signals; a standard error is 1 in χ².
            assert each.cost == pytest.approx(full.cost, abs=1e-3)
            assert each.cost <= other.cost + 1e-3
            (problem,) = p.problems()
            response = simulate(each.block, problem)[:SAMPLES] + each.own[0][0]
            np.testing.assert_allclose(each.simulations[0], response, atol=1e-7 * np.ptp(response))
            exact = each.sensitivity().whitened
            difference = np.linalg.norm(each.whitened_derivative() - exact, axis=0)
            # In samples they are one-sided differences, by signals central ones.
            share = 1e-3 if name in ("pea_dynamics", "coupled") else 1e-4
            assert np.all(difference < share * np.linalg.norm(exact, axis=0))
            # A parameter's share of a step that lowers χ² no further, in its standard error.
            step = np.linalg.lstsq(exact, each.whitened[0], rcond=1e-12)[0]
            errors = np.sqrt(np.diag(np.linalg.pinv(exact.T @ exact, rcond=1e-15)))
            assert np.all(np.abs(step[:-1]) < 5e-3 * errors[:-1])


@pytest.mark.parametrize("history", ["constant", "rest", "estimated"])
@pytest.mark.parametrize("name", ["foh", "pea_dynamics", "coupled"])
def test_the_slopes_in_samples_are_those_of_the_full_model(name, history):
    model = fj.parse_model(name).with_values(SHAPES[name])
    with computing():
        rows = np.array([0, 4, 4])
        problems = [p.problems()[0] for p in preparations(model, True, history)]
        direct = Direct.of(problems)
        shapes = len(layout_of(model.block).shapes)
        around = np.random.default_rng(2).uniform(0.35, 0.65, (3, shapes))
        depends = dependences(model.block, direct.grid)
        found = evaluate(model.block, depends, [direct], rows, around)
        for row, position, cost, slope in zip(rows, around, found.cost, found.slope, strict=True):
            objective = Objective(model.block, (problems[row],))
            assert cost == pytest.approx(objective.at(position).cost, rel=1e-6)
            exact = objective.derivative(position).T @ objective.residual(position)
            np.testing.assert_allclose(slope, exact, rtol=1e-3, atol=1e-4 * np.abs(exact).max())


def test_a_thinned_recording_is_one_of_a_longer_step():
    model = fj.parse_model("pea_dynamics").with_values(SHAPES["pea_dynamics"])
    with computing():
        (problem,) = preparations(model, True)[4].problems()
        smaller = thinned(problem, 4)
        assert float(smaller.grid.step) == pytest.approx(4 * STEP)
        np.testing.assert_array_equal(smaller.response, problem.response[::4])
        # A mode of 25 Hz, sampled at 125 Hz instead of 500 Hz.
        exact, coarse = simulate(model.block, problem)[::4], simulate(model.block, smaller)
    assert np.std(coarse - exact) < 0.05 * np.std(exact)


@pytest.mark.parametrize("fixed", [{}, {"k_h": 0.04}], ids=["free", "k_h fixed"])
def test_the_slopes_of_a_descent_are_those_of_differences(fixed):
    """Of χ² of the full model; with k_h fixed, the response without gains depends on α."""
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    with computing():
        block = apply_options(model, fixed=fixed, bounds={})[0]
        problems = preparations(model, True)[0].problems()
        compressed = compress(block, problems)
        assert compressed is not None
        stack, step = Stack.of_one(compressed.problems[0]), 1e-4
        around = np.array([0.4, 0.6]) + step * np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]])
        rows = np.zeros(len(around), int)
        found = evaluate(block, dependences(block, stack.grid), [stack], rows, around)
        assert found.cost[0] == pytest.approx(Objective(block, problems).at(around[0]).cost)
    differences = (found.cost[1:3] - found.cost[3:5]) / (2 * step)
    np.testing.assert_allclose(2 * found.slope[0], differences, rtol=1e-5)


def test_what_drives_a_second_block_takes_memory_too():
    """Each signal of the first block drives it, so that fewer rows make a stack."""
    times, largest = STEP * np.arange(2**15), {}
    with computing():
        recording = fj.Recording(np.sin(times), np.sin(times), STEP)
        (problem,) = prepare([recording], noise=None, history="constant").problems()
        problems = [replace(problem, drive=k + problem.drive) for k in range(64)]
        for name in ("foh", "foh >> creep"):
            stacks = list(_groups([fj.parse_model(name).block] * 64, problems))
            assert sorted(row for rows, _ in stacks for row in rows) == list(range(64))
            largest[name] = max(len(rows) for rows, _ in stacks)
    assert largest["foh >> creep"] < largest["foh"]


def test_signals_of_fewer_drives_do_not_serve_more():
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    with computing():
        problems = [p.problems()[0] for p in preparations(model, True)]
        few, more = (signals_of(model.block, problems[:count]) for count in (2, 5))
    assert few is not None
    assert more is not None
    assert [np.unique(signals.drives).size for signals in (few, more)] == [2, 5]


def test_estimated_histories_are_stacked_too():
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    with computing():
        prepared = preparations(model, True, "estimated")
        together = fit_blocks([model.block] * 5, prepared, 4, 0)
        for each, p in zip(together, prepared, strict=True):
            assert each.stacked
            assert each.cost == pytest.approx(solve_from([each.block], p).cost, rel=1e-7)


def test_a_row_is_as_it_would_be_alone_whatever_stands_next_to_it():
    """Also where the others differ in length, or one of them is a thousand times as large."""
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    with computing():
        prepared = preparations(model, True)
        (take,) = prepared[1].takes
        huge = fj.Recording(take.recording.drive, 1e60 * take.recording.response, STEP)
        short = take.recording.window(0, 500)
        others = [prepare([each], history="constant") for each in (huge, short)]
        together = fit_blocks([model.block] * 7, [*prepared, *others], 4, 0)[:5]
        alone = [fit_blocks([model.block], [p], 4, 0)[0] for p in prepared]
    for one, other in zip(together, alone, strict=True):
        assert one.cost == pytest.approx(other.cost, abs=1e-3)
        for name, parameter in fj.Model(other.block, "foh").parameters.items():
            value = fj.Model(one.block, "foh").parameters[name].value
            assert value == pytest.approx(parameter.value, rel=1e-4)


def test_what_needs_the_full_model_is_not_stacked():
    foh, bouc_wen = (fj.parse_model(name).block for name in ("foh", "bouc_wen"))
    with computing():
        one, two, *_ = preparations(fj.parse_model("foh"), True)
        joint = Preparation((*one.takes, *two.takes), 1)
        assert can_stack(foh)
        assert not can_stack(bouc_wen)
        assert is_alone(one)
        assert not is_alone(joint)
        # From two starts each is searched for on the full model, as in `fit`.
        assert not fit_blocks([foh], [one], 2, 0)[0].stacked


def test_a_problem_that_is_not_accurate_enough_is_left_to_the_full_model(monkeypatch):
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    with computing():
        prepared = preparations(model, True)[0]
        row = Row(prepared, model.block, np.full((1, 2), 0.5))
        (solved,) = solve_rows([row])
        assert isinstance(solved, Solved)
        monkeypatch.setattr("fracjax._solve._by_signals._SHARE_OF_NOISE", 1e-15)
        assert solve_rows([row]) == [None]


def test_a_row_that_is_not_accurate_enough_leaves_the_others_in_their_stack(monkeypatch):
    """The second, whose response counts as wrong, and no other is left to the full model."""
    model = fj.parse_model("foh").with_values(SHAPES["foh"])
    respond_all = _by_signals.respond_all

    def respond(blocks, problems, short=False):
        responses = respond_all(blocks, problems, short)
        return [
            (1 + 1e-3 * np.sin(np.arange(len(response)))) * response if problem is bad else response
            for response, problem in zip(responses, problems, strict=True)
        ]

    with computing():
        prepared = preparations(model, True)
        rows = [Row(p, model.block, np.full((1, 2), 0.5)) for p in prepared]
        bad = rows[2].problem
        monkeypatch.setattr(_by_signals, "respond_all", respond)
        solved = solve_rows(rows)
    assert [one is None for one in solved] == [False, False, True, False, False]


@pytest.mark.parametrize("name", ["foh", "lfdh"])
def test_what_spans_many_drives_is_accurate_for_each(name):
    """LFDH's signals are nearly alike, and their combinations raise the errors of each."""
    model = fj.parse_model(name).with_values(SHAPES[name])
    times, generator = STEP * np.arange(SAMPLES), np.random.default_rng(1)
    with computing():
        problems = []
        for _ in range(24):
            frequencies, phases = (
                generator.uniform([0.5, 3, 9], [2, 8, 15]),
                generator.uniform(size=3),
            )
            angles = 2 * np.pi * (np.outer(times, frequencies) + phases)
            drive = 40 + np.sin(angles) @ [14, 8, 5]
            recording = fj.Recording(drive, drive, STEP)
            problems += prepare([recording], history="constant").problems()
        positions = generator.uniform(0.1, 0.9, (24, len(SHAPES[name]) - 2 - (name == "foh")))
        blocks = [with_shapes_at(model.block, position) for position in positions]
        spanned = respond_rows(blocks, problems)
        for block, problem, response in zip(blocks, problems, spanned, strict=True):
            exact = np.asarray(simulate(block, problem))
            np.testing.assert_allclose(response, exact, atol=1e-7 * np.ptp(exact))


@pytest.mark.parametrize("samples", [32, 40, 60])
@pytest.mark.parametrize("model", ["lfdh", "pea_dynamics"])
def test_a_recording_of_fewer_samples_than_signals_is_fitted(model, samples):
    times = STEP * np.arange(samples)
    drive = 50 + 30 * np.sin(2 * np.pi * 9 * times) + 10 * np.sin(2 * np.pi * 40 * times)
    noise = 0.01 * np.random.default_rng(0).standard_normal(samples)
    recording = fj.Recording(drive, 0.07 * drive + noise, STEP)
    assert fj.fit(model, recording, starts=4).scores.rmse < 0.015


def test_a_fit_of_one_sine_that_has_few_signals():
    """Fewer columns than the QR takes at once."""
    times = STEP * np.arange(1500)
    drive = 80 * np.sin(2 * np.pi * 2 * times)
    noise = 0.003 * np.random.default_rng(0).standard_normal(1500)
    found = fj.fit("foh", fj.Recording(drive, 0.05 * drive + noise, STEP), starts=4)
    assert found.scores.rmse < 0.004

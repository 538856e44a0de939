"""Models as far as effects have been added: layers, paths, and the model without one of them."""

from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS, Setting
from fracjax._diagnose._stage import Layer, Stage, path_of, wrapped
from fracjax._fit import _solve, prepare, solve_from
from fracjax._fit._least_squares import Objective
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values

TIMES = np.linspace(0, 2, 300)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES)
ORDERS = [
    ("creep", "electrostriction", "thermal_drift"),
    ("drive_lag", "minor_loop_memory", "resonance"),
    ("mains_interference", "creep", "saturation"),
]


@pytest.fixture
def setting() -> Setting:
    recording = fj.Recording(DRIVE, 0.1 * DRIVE, TIMES[1], "V", "um")
    return prepare([recording]).setting


def layers_of(names, setting) -> tuple[Layer, ...]:
    return tuple(Layer(EFFECTS[n], EFFECTS[n].trials(setting)[0]) for n in names)


def stage_of(names, setting) -> Stage:
    recording = fj.Recording(DRIVE, 0.1 * DRIVE, TIMES[1], "V", "um")
    preparation = prepare([recording], history="constant")
    base = fj.parse_model("foh", setting).block
    layers = layers_of(names, setting)
    block = wrapped(base, [(layer, layer.trial) for layer in layers])
    with jax.enable_x64(True):
        solved = solve_from([block], preparation, hopeless=0.0)
    return Stage("foh", base, layers, solved, preparation)


@pytest.mark.parametrize("names", ORDERS)
def test_a_path_leads_to_each_effects_own_parameters(names, setting):
    layers = layers_of(names, setting)
    block = wrapped(fj.blocks.FOH(), [(layer, layer.trial) for layer in layers])
    known = named_parameters(block)
    for k, layer in enumerate(layers):
        own = {f"{path_of(layers, k)}{name}" for name in named_parameters(layer.trial)}
        assert own == {name for name in known if name.startswith(path_of(layers, k))}


@pytest.mark.parametrize("names", ORDERS)
@pytest.mark.parametrize("dropped", [0, 1, 2])
def test_the_model_without_a_layer_is_the_model_of_the_others(names, dropped, setting):
    stage = stage_of(names, setting)
    kept = [name for k, name in enumerate(names) if k != dropped]
    less = stage.fitted_without(dropped)
    shaped = wrapped(stage.nominal, [(x, x.trial) for x in layers_of(kept, setting)])
    assert jax.tree_util.tree_structure(less) == jax.tree_util.tree_structure(shaped)
    whole, values = named_parameters(stage.solved.block), named_parameters(less)
    k = 0 if dropped else 1
    layers = layers_of(kept, setting)
    for name in named_parameters(layers[0].trial):
        left = values[f"{path_of(layers, 0)}{name}"].value
        assert np.array_equal(left, whole[f"{path_of(stage.layers, k)}{name}"].value)


def test_a_name_is_written_as_one_would_write_the_model(setting):
    assert stage_of(ORDERS[0], setting).name == (
        "(electrostriction >> (foh >> creep)) + thermal_drift"
    )


@pytest.mark.parametrize(
    "text",
    [
        "foh",
        "foh >> creep",
        "drive_lag >> foh >> resonance",
        "electrostriction >> foh + minor_loop_memory",
        "saturation >> (foh + thermal_drift) >> creep",
        "lfdh >> resonance",
        "bouc_wen >> drive_lag",
    ],
)
def test_derivatives_law_by_law_are_those_of_the_whole(text, setting):
    """Against JAX through the whole composition at once."""
    with jax.enable_x64(True):
        block = fj.parse_model(text, setting).block
        grid, drive = Grid(np.asarray(TIMES[1]), "constant"), jnp.asarray(DRIVE)
        names = list(named_parameters(block))
        response, columns, changes = block.linearise(DRIVE, grid, names, [np.sin(DRIVE)])
        # Two programs, which round differently: to what a kernel is as good as.
        alone = block.respond(DRIVE, grid)
        np.testing.assert_allclose(alone, response, atol=1e-11 * np.abs(response).max(), rtol=0)
        values = {n: jnp.asarray(p.value) for n, p in named_parameters(block).items()}

        @jax.jit
        def whole(values, drive):
            def respond(values, drive):
                return set_values(block, values)(drive, grid)

            along = jax.jvp(lambda u: respond(values, u), (drive,), (jnp.sin(drive),))[1]
            return respond(values, drive), jax.jacfwd(respond)(values, drive), along

        wanted, derivatives, along = whole(values, drive)
        np.testing.assert_allclose(response, wanted, atol=1e-9 * np.abs(response).max())
        np.testing.assert_allclose(changes[0], along, atol=1e-9 * np.abs(along).max())
        for name in names:
            column = derivatives[name].reshape(drive.size, -1)
            size = np.abs(column).max() + 1e-300
            np.testing.assert_allclose(columns[name], column, atol=1e-8 * size)


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize("count", [1, 3, 4])
def test_changes_pass_a_linear_law_beside_its_drive(count, history, setting):
    with jax.enable_x64(True):
        block = fj.parse_model("creep", setting).block
        grid = Grid(np.asarray(TIMES[1]), history)
        along = [np.sin(DRIVE + k) for k in range(count)]
        response, columns, changes = block.linearise(DRIVE, grid, [], along)
        assert (columns, len(changes)) == ({}, count)
        for signal, found in zip([DRIVE, *along], [response, *changes], strict=True):
            wanted = block.respond(signal, grid)
            np.testing.assert_allclose(found, wanted, atol=1e-11 * np.abs(wanted).max(), rtol=0)


def test_a_least_squares_step_is_that_of_all_rows(setting):
    """Gauss and Newton's, its promise and the gradient, of one turned row per shape and one."""
    with jax.enable_x64(True):
        model = fj.parse_model("foh >> creep", setting)
        response = np.tanh(DRIVE / 50) + 0.01 * np.cos(40 * TIMES)
        recording = fj.Recording(DRIVE, response, float(TIMES[1]), "V", "um")
        preparation = prepare([recording], history="constant")
        objective = Objective(model.block, preparation.problems())
        position = objective.numbers.position_of(model.block)
        rows, residual = objective.derivative(position), objective.residual(position)
        turned, length = objective.turned(position), objective.length(position)
        assert turned.shape == (position.size + 1, position.size)
        np.testing.assert_allclose(length @ length, residual @ residual, rtol=1e-12)
        np.testing.assert_allclose(turned.T @ turned, rows.T @ rows, rtol=1e-10)
        np.testing.assert_allclose(turned.T @ length, rows.T @ residual, rtol=1e-8)
        step = [np.linalg.lstsq(*pair)[0] for pair in ((rows, residual), (turned, length))]
        np.testing.assert_allclose(*step, rtol=1e-6)


def test_a_start_that_would_overtake_the_best_is_followed(setting, monkeypatch):
    """One start ends at once, the other falls from far above to below it, on more looks than the
    first rounds have."""
    courses = {"near": [6.0, 6.0], "far": [45.0, 20.0, 8.0, 1.0], "idle": [50.0, 49.0, 48.0]}

    def descend(at, looks):
        left = at.course[1:] if at.course[1:] else at.course
        return at._replace(course=left, cost=at.course[0], converged=not at.course[1:])

    class Course(NamedTuple):
        name: str

        def at(self, _: int) -> SimpleNamespace:
            return SimpleNamespace(residual=np.array([1e3 * list(courses).index(self.name)]))

    class Fake(NamedTuple):
        course: list[float]
        cost: float
        converged: bool
        objective: Course
        position: int = 0
        evaluations: int = 0

    monkeypatch.setattr(_solve, "begin", lambda s, *_: Fake(courses[s], np.inf, False, Course(s)))
    monkeypatch.setattr(_solve, "descend", descend)
    monkeypatch.setattr(_solve, "solved_at", lambda objective, *_, **__: objective.name)
    recording = fj.Recording(DRIVE, 0.1 * DRIVE, TIMES[1], "V", "um")
    starts: list = ["near", "far", "idle"]
    assert _solve.solve_from(starts, prepare([recording], history="constant")) == "far"


def test_the_kurtosis_of_a_fit_is_that_of_the_samples_that_count(setting):
    noise = np.random.default_rng(0).standard_normal(TIMES.size)
    recording = fj.Recording(DRIVE, 0.1 * DRIVE + 0.01 * noise, TIMES[1], "V", "um")
    half = prepare([recording], history="constant", mask=[(0.0, 1.0)])
    with jax.enable_x64(True):
        solved = solve_from([fj.parse_model("foh", setting).block], half)
    # Zeros for what does not count would make twice of it.
    assert solved.kurtosis == pytest.approx(3, abs=0.8)

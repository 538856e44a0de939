"""What effects would add to a response, against the same forces from outside; what else might."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lsim

import fracjax as fj
from fracjax._blocks import INSIDE, HystereticSpring, Lag, Modes, Motion, Oscillator, Within
from fracjax._computing import computing
from fracjax._inside import Columns, _columns, columns_of
from fracjax._parameters import set_values
from fracjax._prepare import prepare
from tests.helpers import close

COUNT, STEP = 96, 0.02  # as many as a problem is padded to
STORES = Lag(0.8, (0.4, 1.1))


def recording(seed: int) -> fj.Recording:
    """A drive of chance, smooth over a few samples."""
    rng = np.random.default_rng(seed)
    drive = np.convolve(rng.standard_normal(COUNT + 4), np.ones(5) / 5, "valid") + 2.0
    return fj.Recording(drive, 0.1 * rng.standard_normal(COUNT), STEP, "V", "um")


def columns(
    block: Within, *effects: str, seeds=(1,), monkeypatch, others=None
) -> tuple[Columns, Any]:
    """The columns of some effects about a block, on a grid of half the step, and the problems."""
    monkeypatch.setattr(_columns, "INSIDE", {name: INSIDE[name] for name in effects})
    preparation = prepare([recording(seed) for seed in seeds], history="rest", settling=0)
    preparation = preparation.with_oversampling(2)
    problems = preparation.problems()
    rng = np.random.default_rng(5)
    solved: Any = SimpleNamespace(
        preparation=preparation, blocks=len(seeds) * (block,),
        whitened=[rng.standard_normal(COUNT) for _ in seeds],
        whitened_derivative=lambda: rng.standard_normal((COUNT * len(seeds), 2)),
    )  # fmt: skip
    with computing():
        return columns_of(solved, others), problems


def motion_of(block: Within, problem: Any) -> Motion:
    pushes = jnp.zeros((1, np.size(problem.drive)))
    return block.respond_to(jnp.asarray(problem.drive), pushes, problem.grid)[1]


def pushed(block: Within, problem: Any, forces: np.ndarray) -> np.ndarray:
    """What forces (p, M) from outside change of the response, whitened; of a linear machine."""
    drive, none = jnp.asarray(problem.drive), jnp.zeros_like(forces)
    ends = [block.respond_to(drive, jnp.asarray(f), problem.grid)[0] for f in (forces, none)]
    return problem.whiten(np.asarray(ends[0] - ends[1])[::2])


NO_OTHERS: dict = {"drive_curve": []}


def test_a_column_is_what_the_same_flow_from_outside_adds_at_each_port_and_at_both(monkeypatch):
    """Of two recordings: sizes are those of both together."""
    block = set_values(Within(STORES), {"start": np.array([0.3, -0.2])})
    made, problems = columns(
        block, "root_outflow", "cubic_stiffness", seeds=(1, 2), monkeypatch=monkeypatch,
        others=NO_OTHERS,
    )  # fmt: skip
    assert [*made.effects] == ["root_outflow"]  # no port takes a force
    shapes = made.effects["root_outflow"]
    sites = [tuple(site for site, _ in shape.inside) for shape in shapes]
    assert sites == 3 * [("outflow",)] + 3 * [("last",)] + 3 * [("outflow", "last")]
    motions = [motion_of(block, problem) for problem in problems]
    for k in range(2):
        both = Motion(*(np.concatenate([m[n][k] for m in motions]) for n in range(3)))
        for shape, trial in zip(shapes[3 * k :], INSIDE["root_outflow"].trials(both), strict=False):
            effect: Any = shape.inside[0][1]
            assert float(effect.outflow.value) == pytest.approx(float(trial.outflow.value))  # type: ignore[attr-defined]
            assert float(effect.empty.value) == pytest.approx(float(trial.empty.value))  # type: ignore[attr-defined]
            wanted = []
            for problem, motion in zip(problems, motions, strict=True):
                forces = np.zeros((2, motion.drive.shape[1]))
                forces[k] = np.asarray(trial.force(motion))[k]  # type: ignore[attr-defined]
                wanted.append(pushed(block, problem, forces))
            wanted = np.concatenate(wanted)
            close(shape.white[:, 0], wanted, 1e-9)
            assert shape.white.shape == (2 * COUNT, 1)
            assert shape.machine is block.machine
    for k, shape in enumerate(shapes[6:]):
        alone = np.concatenate([shapes[k].white, shapes[3 + k].white], axis=1)
        np.testing.assert_array_equal(shape.white, alone)
        assert [effect for _, effect in shape.inside] == [
            shapes[k].inside[0][1], shapes[3 + k].inside[0][1]
        ]  # fmt: skip
        assert shape.machine is block.machine
    assert made.others is NO_OTHERS
    assert made.residual.shape == (2 * COUNT,)
    assert made.tangent.shape == (2 * COUNT, 2)
    responses = [p.whiten(p.response - p.response.mean()) for p in problems]
    assert made.size == pytest.approx(np.linalg.norm(np.concatenate(responses)))


def test_what_a_port_has_has_no_column_there(monkeypatch):
    block = Within(STORES).at("last", INSIDE["root_outflow"].trials(MOVED)[0])
    made, _ = columns(block, "root_outflow", monkeypatch=monkeypatch, others=NO_OTHERS)
    assert [shape.inside[0][0] for shape in made.effects["root_outflow"]] == 3 * ["outflow"]
    assert [len(shape.inside) for shape in made.effects["root_outflow"]] == 3 * [1]
    # Where it is at both, there is none.
    both = block.at("outflow", INSIDE["root_outflow"].trials(MOVED)[0])
    made, _ = columns(both, "root_outflow", monkeypatch=monkeypatch, others=NO_OTHERS)
    assert made.effects == {}


MOVED = Motion(*np.random.default_rng(1).standard_normal((3, 50)))


def test_an_effect_that_remembers_acts_along_the_motion(monkeypatch):
    block = Within(Oscillator(0.5, 3.0, 0.08))
    made, (problem,) = columns(
        block, "hysteretic_spring", monkeypatch=monkeypatch, others=NO_OTHERS
    )
    motion = motion_of(block, problem)
    shape = made.effects["hysteretic_spring"][4]
    ((_, spring),) = shape.inside
    assert isinstance(spring, HystereticSpring)
    path = [Motion(*now) for now in np.asarray(motion)[:, 0].T]
    memory, before, forces = spring.memory(), path[0], []
    for now in path:
        force, memory = spring.act(now, before, memory, STEP / 2)
        before, forces = now, [*forces, float(force)]
    wanted = pushed(block, problem, np.array(forces)[None])
    close(shape.white[:, 0], wanted, 1e-9)


def test_a_joint_is_tried_in_each_mode(monkeypatch):
    block = Within(Modes((1.0, -0.4), (2.0, 5.0), (0.05, 0.03)))
    made, (problem,) = columns(block, "cubic_stiffness", monkeypatch=monkeypatch, others=NO_OTHERS)
    shapes = made.effects["cubic_stiffness"]
    assert len(shapes) == 2
    for shape, share in zip(shapes, np.eye(2), strict=True):
        machine: Any = shape.machine
        np.testing.assert_array_equal(machine.joint.value, share)
        placed = Within(machine)
        ((site, spring),) = shape.inside
        assert site == "joint"
        forces = np.asarray(spring.force(motion_of(placed, problem)))  # type: ignore[attr-defined]
        wanted = pushed(placed, problem, forces)
        close(shape.white[:, 0], wanted, 1e-9)


def centred(signal: np.ndarray) -> np.ndarray:
    return (signal - np.mean(signal)) / np.std(signal)


def test_what_is_no_effect_is_a_curve_before_or_after_or_further_modes(monkeypatch):
    block = Within(STORES)
    made, problems = columns(block, seeds=(1, 2), monkeypatch=monkeypatch)
    assert [*made.others] == ["linear_dynamics", "drive_curve", "response_curve"]
    assert made.effects == {}
    (drive_curve,), (response_curve,) = made.others["drive_curve"], made.others["response_curve"]
    modes = made.others["linear_dynamics"]
    assert len(modes) == 12 * 3
    for k, problem in enumerate(problems):
        rows, drive = slice(k * COUNT, (k + 1) * COUNT), np.asarray(problem.drive)
        response = np.asarray(block(jnp.asarray(drive), problem.grid))
        for power in (2, 3):
            before = np.asarray(block(jnp.asarray(centred(drive) ** power), problem.grid))
            after = centred(response) ** power
            for curve, signal in ((drive_curve, before), (response_curve, after)):
                close(curve.white[rows, power - 2], problem.whiten(signal[::2]), 1e-9)
        # A mode at rest that a drive moves, straight between samples and in the step before them.
        frequencies = np.geomspace(1 / (STEP / 2 * drive.size), 1 / STEP / 2, 12)
        for place in (0, 7, 17, 35):
            w, zeta = 2 * np.pi * frequencies[place // 3], (0.03, 0.3, 1.0)[place % 3]
            system = [[0, w], [-w, -2 * zeta * w]], [[0], [w]], np.eye(2), np.zeros((2, 1))
            risen = np.append(0.0, centred(drive))
            moved = lsim(system, risen, STEP / 2 * np.arange(risen.size))[1][1:]
            close(modes[place].white[rows], problem.whiten(moved[::2]), 1e-8)
    assert all(mode.white.shape == (2 * COUNT, 2) for mode in modes)


def test_a_signal_that_is_constant_is_none():
    np.testing.assert_array_equal(_columns._centred(np.full(5, 3.0)), 0.0)
    np.testing.assert_allclose(_columns._centred(np.array([1.0, 3.0])), [-1, 1])

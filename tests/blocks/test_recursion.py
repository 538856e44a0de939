"""Recursions of one state, beside JAX's own derivative through the loop."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks._recursion import recursion, settled

GIVEN = jnp.asarray(np.random.default_rng(0).standard_normal((2, 40)))
SHARED, START = jnp.asarray(0.8), jnp.asarray(0.3)


def step(shared, state, given):
    return jnp.tanh(shared * state + given[0]) + 0.1 * given[1] * state


def by_the_loop(shared, start, given):
    def one(state, at):
        state = step(shared, state, at)
        return state, state

    return jax.lax.scan(one, start, given)[1]


def by_recursion(shared, start, given):
    return recursion(step, shared, start, given)


def energy(states):
    return jnp.sum(states**3)


def inputs():
    return tuple(GIVEN)


def alike(found, wanted):
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True)
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_its_derivative_is_that_through_the_loop(derivative):
    found, wanted = (
        jax.jit(derivative(law, (0, 1, 2)))(SHARED, START, inputs())
        for law in (by_recursion, by_the_loop)
    )
    alike(found, wanted)
    assert all(np.abs(each).max() > 1e-3 for each in jax.tree.leaves(found))


@pytest.mark.parametrize("compiled", [lambda f: f, jax.jit])
def test_its_gradient_is_that_through_the_loop_compiled_or_not(compiled):
    found, wanted = (
        compiled(jax.grad(lambda *at, law=law: energy(law(*at)), (0, 1, 2)))(
            SHARED, START, inputs()
        )
        for law in (by_recursion, by_the_loop)
    )
    alike(found, wanted)


def test_its_second_derivative_is_that_through_the_loop():
    found, wanted = (
        jax.jit(jax.hessian(lambda s, x, law=law: energy(law(s, x, inputs())), (0, 1)))(
            SHARED, START
        )
        for law in (by_recursion, by_the_loop)
    )
    alike(found, wanted)


def test_many_at_once_are_each_one():
    shared = jnp.linspace(0.1, 1.5, 5)
    states, changes = jax.jit(
        jax.vmap(
            lambda s: jax.jvp(lambda s: by_recursion(s, START, inputs()), (s,), (jnp.ones(()),))
        )
    )(shared)
    for k, each in enumerate(shared):
        alike(states[k], by_the_loop(each, START, inputs()))
        alike(changes[k], jax.jacfwd(by_the_loop)(each, START, inputs()))


def test_of_flags_nothing_changes():
    """What each sample was given may hold what has no derivative."""

    def turned(shared, state, given):
        return jnp.where(given[1], -shared * state, state) + given[0]

    moves, turns = GIVEN[0], GIVEN[1] > 0.5
    found = jax.grad(lambda s: energy(recursion(turned, s, START, (moves, turns))))(SHARED)
    size = 1e-6
    ends = [energy(recursion(turned, SHARED + e, START, (moves, turns))) for e in (size, -size)]
    assert found == pytest.approx(float(ends[0] - ends[1]) / (2 * size), rel=1e-7)


def by_cycles(shared, start, given, cycles=60):
    tiled = tuple(jnp.tile(each, cycles) for each in given)
    return by_the_loop(shared, start, tiled)[-given[0].size :]


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_what_has_settled_is_what_many_cycles_come_to(derivative):
    def found(shared, given):
        return settled(step, shared, START, given)

    def wanted(shared, given):
        return by_cycles(shared, START, given)

    alike(found(SHARED, inputs()), wanted(SHARED, inputs()))
    alike(*(jax.jit(derivative(law, (0, 1)))(SHARED, inputs()) for law in (found, wanted)))


def test_what_forgets_little_in_a_cycle_settles_all_the_same():
    """x → .999 x + b tends to 1000 b; of what it starts from a hundred cycles keep nine tenths."""

    def faded(shared, state, given):
        return shared * state + given

    keeps = 0.999 ** (1 / 40)
    inputs = jnp.full(40, (1 - keeps) * 7)
    found = settled(faded, jnp.asarray(keeps), START, inputs)
    np.testing.assert_allclose(found, np.full(40, 7.0), rtol=1e-9)


def test_what_forgets_nothing_stays_where_it_is():
    def kept(shared, state, given):
        return state + shared * given

    still = jnp.zeros(40)
    found = jax.value_and_grad(lambda s: settled(kept, s, START, still)[-1])(SHARED)
    assert found == (START, 0.0)
    assert np.isfinite(settled(kept, SHARED, START, still + 1)).all()


def test_many_settle_at_once():
    shared = jnp.linspace(0.1, 1.2, 5)
    found = jax.vmap(lambda s: settled(step, s, START, inputs()))(shared)
    alike(found, jnp.stack([by_cycles(each, START, inputs()) for each in shared]))

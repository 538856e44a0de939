"""Machines: linear dynamics with states and ports, and with physics at their ports, integrated."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter, named_parameters, replace_parameters, set_values
from .._recording import InputError
from ._block import AbstractBlock, AbstractLinearBlock
from ._inside import AbstractInside
from ._port import Motion, Port, System

_ITERATIONS = 4
"""Newton's steps for the forces at the end of a step, before the last one, which is differentiated:
they start from the forces before the step, or where the motion is stopped."""
_CYCLES = 12
"""Newton's steps at most for the start of a steady cycle."""
_HALVINGS, _TERMS = 20, 10
"""Halvings and terms of the matrix exponential: exact to rounding up to 10^6 time constants a step.
"""
_CLOSED = 1e-10
"""The change of that start, over its largest component, at which the cycle is closed."""


class AbstractMachine(AbstractLinearBlock):
    """A linear block with states and ports: drive (N,) → response (N,), in their units.

    Alone it is a linear block like any other.  `machine @ effect` adds physics at a port, which
    depends on the motion that it changes: no block before or after the machine can express it.
    """

    @abc.abstractmethod
    def system(self) -> System:
        """The dynamics in states x (n,)."""

    @abc.abstractmethod
    def ports(self) -> dict[str, Port]:
        """The ports by name; an effect takes the first of its kind unless told."""

    @abc.abstractmethod
    def scales(self) -> Array:
        """(n,) the unit that each state is measured in, over the response's [s^k]."""

    @property
    def settles(self) -> bool:
        """Whether a constant drive leads to an equilibrium, as it does where a spring holds."""
        return True

    @property
    def drifts(self) -> bool:
        """Whether a constant drive moves the response on and on."""
        return False

    def start(self, drive: Array, grid: Grid) -> Array:
        """The states (n,) before the first sample: in equilibrium with a constant drive, or 0."""
        a, b, *_ = self.system()
        if grid.history == "rest" or not self.settles:
            return jnp.zeros_like(b)
        return -jnp.linalg.solve(a, b) * drive[0]

    def opened(self, site: str) -> AbstractMachine:
        """This machine with the parameters free that what acts at a port depends on."""
        return self

    def placements(self, site: str) -> tuple[AbstractMachine, ...]:
        """This machine with a port at every place that its linear response leaves open."""
        return (self,)

    def __matmul__(self, effect: AbstractInside) -> Within:
        """This machine with an effect at its first port of the effect's kind."""
        return Within(self) @ effect


class _Step(NamedTuple):
    """One step of the linear machine: x1 = Φ x0 + forced + P f0 + Q f1.

    Attributes:
        carried: Φ (n, n).
        before: P (n, p), of the forces at the beginning of the step.
        after: Q (n, p), of those at its end.
    """

    carried: Array
    before: Array
    after: Array


class Within(AbstractBlock):
    r"""A machine with forces or flows at its ports that depend on its motion:

        dx/dt = A x + b u + Σ_i e_i f_i(q_i, dq_i/dt, u),    q_i = p_i x
        y = c x + d u + Σ_i d_i f_i

    The linear part is exact for a drive and forces that are straight between samples (an
    exponential integrator); the forces at the end of each step solve their equation by Newton's
    method, so that stiff stops and dry friction do not limit the step.  The error is of second
    order in the step, of first where a force can stop the motion.  `start` is what the states
    deviate by, at the first sample, from what the history says, so that a recording may begin in
    motion.  u is the drive plus `drive_offset`: an amplifier's zero, a dead voltage, a weight.  A
    linear machine answers it by an offset of the response, one with physics inside does not, since
    a cubic spring that is displaced is stiffer and no longer odd.

    Args:
        machine: the linear machine.
        effects: the physics inside it.
        sites: the port of each.

    Attributes:
        machine: the linear machine, from drive unit to response unit.
        effects: the physics inside it; forces and flows are in drive units.
        sites: the port of each.
        start: (n,) the deviation of the states at the first sample [response], a velocity over the
            machine's own rate.
        drive_offset: u_0, one number [drive]; free where it differs from one of the response.

    Source: Hochbruck & Ostermann, Acta Numer. 19 (2010) 209, exponential integrators; Acary &
    Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), implicit friction.
    """

    machine: AbstractMachine
    effects: tuple[AbstractInside, ...]
    sites: tuple[str, ...] = eqx.field(static=True)
    start: Parameter
    drive_offset: Parameter

    def __init__(
        self,
        machine: AbstractMachine,
        effects: tuple[AbstractInside, ...] = (),
        sites: tuple[str, ...] = (),
    ):
        for site in sites:
            machine = machine.opened(site)
        if np.size(machine.scales()):
            # With forces that depend on the motion, the response is linear in no gain.
            gains = {n: p.as_shape() for n, p in named_parameters(machine).items() if p.gain}
            machine = replace_parameters(machine, gains)
        self.machine = machine
        self.effects, self.sites = effects, sites
        states = np.zeros(np.shape(machine.scales()))
        self.start = Parameter(states, "response", per_recording=True)
        # Where nothing holds the machine, a constant drive moves it on, which every effect meets.
        is_placed = any(effect.is_placed or not machine.settles for effect in effects)
        differs = states.size > 0 and (is_placed or machine.drifts)
        self.drive_offset = Parameter(0.0, "drive", fixed=not differs)

    @property
    def linear(self) -> bool:
        return False

    @property
    def leads(self) -> bool:
        return self.machine.leads

    def __matmul__(self, effect: AbstractInside) -> Within:
        """This machine with one more effect at its first port of the effect's kind."""
        ports = self.machine.ports()
        site = next((name for name, port in ports.items() if port.kind == effect.kind), None)
        if site is None:
            kinds = ", ".join(f"{name} ({port.kind})" for name, port in ports.items())
            raise InputError.at(
                f"{type(self.machine).__name__} @ {type(effect).__name__}",
                f"a machine with a port for a {effect.kind}",
                f"one with the ports {kinds or 'none'}",
                "choose another machine or another effect",
            )
        return self.at(site, effect)

    def at(self, site: str, effect: AbstractInside) -> Within:
        """This machine with one more effect.

        Args:
            site: the port's name.
            effect: what acts there [drive unit].

        Returns:
            The block with the effect.
        """
        more = Within(self.machine, (*self.effects, effect), (*self.sites, site))
        return more._beginning_as(self)

    def without(self, which: int) -> Within:
        """This machine without one of its effects, by its place among them."""
        effects, sites = list(self.effects), list(self.sites)
        del effects[which], sites[which]
        return Within(self.machine, tuple(effects), tuple(sites))._beginning_as(self)

    def placements(self, site: str) -> tuple[Within, ...]:
        """This machine with a port at every place that it may have: one, where an effect is."""
        if site in self.sites:
            return (self,)
        machines = self.machine.placements(site)
        return tuple(eqx.tree_at(lambda block: block.machine, self, m) for m in machines)

    def _beginning_as(self, other: Within) -> Within:
        """This machine with the start of another, fixed where that is, and its drive's offset."""
        begun = eqx.tree_at(lambda block: block.start, self, other.start)
        return set_values(begun, {"drive_offset": other.drive_offset.value})

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.respond_to(drive, jnp.zeros((1, drive.size)), grid)[0]

    def respond_to(self, drive: Array, pushes: Array, grid: Grid) -> tuple[Array, Motion]:
        """The response, and the motion at every port, to a drive and to forces from outside.

        Args:
            drive: (N,), in drive units.
            pushes: (p, N) forces or flows at the machine's ports in their order, in drive units;
                (1, N) zeros for none.
            grid: step [s] and history.

        Returns:
            The response (N,) in response units, and the motion at the ports, arrays (p, N).
        """
        ports = list(self.machine.ports().values())
        drive = drive + self.drive_offset.value
        pushes = jnp.broadcast_to(pushes, (len(ports), drive.size))
        if not self.machine.scales().size:
            return self._follow(drive, pushes, grid)
        system = self.machine.system()
        start = self.machine.start(drive, grid) + self.start.value * self.machine.scales()
        if grid.history == "periodic":
            start = self._cycle(system, ports, (drive, pushes), start, grid)
        states, forces = self._integrate(system, ports, (drive, pushes), start, grid)
        direct = jnp.stack([jnp.asarray(port.direct, float) for port in ports])
        response = states @ system.c + system.d * drive + direct @ forces
        positions, velocities = (
            jnp.stack([getattr(port, name) @ states.T for port in ports])
            for name in ("position", "velocity")
        )
        return response, Motion(positions, velocities, jnp.broadcast_to(drive, positions.shape))

    def _follow(self, drive: Array, pushes: Array, grid: Grid) -> tuple[Array, Motion]:
        """The response of a machine whose drive is the motion itself: nothing acts back on it."""
        changes = grid.changes(drive) / grid.step
        velocity = 0.5 * (changes + jnp.append(changes[1:], changes[-1]))
        motion = Motion(drive, velocity, drive)

        def step(carry: tuple, now: Motion) -> tuple[tuple, Array]:
            before, memories = carry
            total, kept = jnp.zeros(()), []
            for effect, memory in zip(self.effects, memories, strict=True):
                force, memory = effect.act(now, before, memory, grid.step)
                total, kept = total + force, [*kept, memory]
            return (now, tuple(kept)), total

        first = Motion(*(signal[0] for signal in motion))
        begin = (first, tuple(effect.memory() for effect in self.effects))
        forces = jax.lax.scan(step, begin, motion)[1] + pushes[0]
        response = self.machine(drive, grid) - forces
        return response, Motion(*(signal[None] for signal in motion))

    def _integrate(
        self,
        system: System,
        ports: list[Port],
        inputs: tuple[Array, Array],
        start: Array,
        grid: Grid,
    ) -> tuple[Array, Array]:
        """States (N, n) and forces (p, N) from the states (n,) at the first sample."""
        drive, pushes = inputs
        names, used = list(self.machine.ports()), [*dict.fromkeys(self.sites)]
        places = [names.index(name) for name in used]
        n, p = system.b.size, len(used)
        enters = jnp.stack([port.enters for port in ports], axis=1)
        step, forced = _stepped(system, enters, grid.step)
        if any(effect.sticks for effect in self.effects):
            step = step._replace(before=jnp.zeros_like(step.before), after=step.before + step.after)
        outside = (
            drive[:-1, None] * forced[0] + drive[1:, None] * forced[1]
            + pushes[:, :-1].T @ step.before.T + pushes[:, 1:].T @ step.after.T
        )  # fmt: skip
        seen = [(ports[k].position, ports[k].velocity) for k in places]
        before, after = (
            step.before[:, jnp.array(places, int)],
            step.after[:, jnp.array(places, int)],
        )
        at = [used.index(site) for site in self.sites]

        def motions(states: Array, u: Array) -> list[Motion]:
            return [Motion(jnp.sum(q * states), jnp.sum(v * states), u) for q, v in seen]

        def acting(
            effects: tuple, now: list[Motion], past: list[Motion], memories: tuple
        ) -> tuple[Array, tuple]:
            """The forces (p,) at the used ports, and what is remembered."""
            totals, kept = [jnp.zeros(())] * p, []
            for effect, port, memory in zip(effects, at, memories, strict=True):
                force, memory = effect.act(now[port], past[port], memory, grid.step)
                totals[port], kept = totals[port] + force, [*kept, memory]
            return jnp.stack(totals), tuple(kept)

        def defect(f: Array, effects: tuple, free: Array, after: Array, rest: tuple) -> Array:
            u, past, memories = rest
            return f - acting(effects, motions(free + after @ f, u), past, memories)[0]

        def advance(carry: tuple, sample: tuple[Array, Array, Array]) -> tuple[tuple, tuple]:
            states, forces, memories = carry
            outer, past_drive, u = sample
            past = motions(states, past_drive)
            free = step.carried @ states + outer + before @ forces
            if not p:
                return (free, forces, memories), (free, forces)
            guess = forces
            if any(effect.sticks for effect in self.effects):
                reach = jnp.stack([v @ after[:, k] for k, (_, v) in enumerate(seen)])
                guess = -jnp.stack([v @ free for _, v in seen]) / reach
            equation = self.effects, free, after, (u, past, memories)
            frozen = jax.lax.stop_gradient(equation)

            def improve(_: int, guess: Array) -> Array:
                return guess - _solve(jax.jacfwd(defect)(guess, *frozen), defect(guess, *frozen))

            guess = jax.lax.fori_loop(0, _ITERATIONS, improve, jax.lax.stop_gradient(guess))
            # One step that is differentiated, from the solution, gives the solution's derivative.
            slope = jax.jacfwd(defect)(guess, *frozen)
            guess = guess - _solve(slope, defect(guess, *equation))
            states = free + after @ guess
            memories = acting(self.effects, motions(states, u), past, memories)[1]
            return (states, guess, memories), (states, guess)

        memories = tuple(effect.memory() for effect in self.effects)
        first = motions(start, drive[0])
        forces = acting(self.effects, first, first, memories)[0] if p else jnp.zeros(0)
        samples = (outside, drive[:-1], drive[1:])
        _, (later, acted) = jax.lax.scan(advance, (start, forces, memories), samples)
        inner = jnp.concatenate([forces[None], acted]).T
        every = pushes + (
            jnp.zeros((len(ports), p)).at[jnp.array(places, int), jnp.arange(p)].set(1.0) @ inner
            if p
            else 0.0
        )
        return jnp.concatenate([start[None], later]).reshape(-1, n), every

    def _cycle(
        self,
        system: System,
        ports: list[Port],
        inputs: tuple[Array, Array],
        start: Array,
        grid: Grid,
    ) -> Array:
        """The states (n,) at the first sample of a steady cycle, which ends where it begins."""
        closed = (jnp.append(inputs[0], inputs[0][0]), jnp.append(inputs[1], inputs[1][:, :1], 1))

        def end(first: Array) -> Array:
            return self._integrate(system, ports, closed, first, grid)[0][-1]

        def improved(first: Array) -> Array:
            last, changes = end(first), jax.jacfwd(lambda x: end(x))(first)
            slope = jax.lax.stop_gradient(jnp.eye(first.size) - changes)
            return first + jnp.linalg.solve(slope, last - first)

        def improve(at: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            first = improved(at[0])
            size = jnp.abs(first).max() + jnp.finfo(float).tiny
            return first, jnp.abs(first - at[0]).max() / size, at[2] + 1

        def is_open(at: tuple[Array, Array, Array]) -> Array:
            return (at[1] > _CLOSED) & (at[2] < _CYCLES)

        begin = (start, jnp.asarray(jnp.inf), jnp.zeros((), int))
        fixed = jax.lax.stop_gradient(
            jax.lax.while_loop(is_open, improve, jax.lax.stop_gradient(begin))[0]
        )
        return improved(fixed)


def _stepped(system: System, enters: Array, step: Any) -> tuple[_Step, tuple[Array, Array]]:
    """One step of the linear machine, and how the drive (before, after) enters it: (n,) each.

    The matrix exponential of the dynamics with inputs that are straight lines.
    Source: Franklin, Powell & Workman, Digital Control of Dynamic Systems (1998), section 6.3.2.
    """
    n, inputs = system.b.size, jnp.concatenate([system.b[:, None], enters], axis=1)
    m = inputs.shape[1]
    whole = jnp.zeros((n + 2 * m, n + 2 * m))
    whole = whole.at[:n, :n].set(system.a * step).at[:n, n : n + m].set(inputs * step)
    whole = whole.at[n : n + m, n + m :].set(jnp.eye(m))
    power = _exponential(whole)
    held, ramp = power[:n, n : n + m], power[:n, n + m :]
    before = held - ramp
    return _Step(power[:n, :n], before[:, 1:], ramp[:, 1:]), (before[:, 0], ramp[:, 0])


def _exponential(matrix: Array) -> Array:
    """exp of a matrix: its series at 2^-20 of it, and squarings of exp - 1, which cancel nothing.

    It compiles in a tenth of the time of JAX's own.
    Source: Moler & Van Loan, SIAM Rev. 45 (2003) 3, method 3.
    """
    identity, part = jnp.eye(len(matrix)), matrix / 2**_HALVINGS
    excess = jnp.zeros_like(matrix)
    for k in range(_TERMS, 0, -1):
        excess = part @ (identity + excess) / k

    def square(_: int, excess: Array) -> Array:
        return 2 * excess + excess @ excess

    return identity + jax.lax.fori_loop(0, _HALVINGS, square, excess)


def _solve(slope: Array, value: Array) -> Array:
    """The solution (p,) of slope (p, p) times it = value (p,)."""
    if value.size == 1:
        return value / slope[0]
    return jnp.linalg.solve(slope, value)

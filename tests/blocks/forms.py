"""Machines with the closed forms of their transfer functions, written from the equations."""

from collections.abc import Callable

import numpy as np

from fracjax._blocks import AbstractMachine, Filters, Lag, Mass, Modes, Oscillator
from fracjax._parameters import set_values

JW = 2j * np.pi * np.array([1e-9, 0.07, 0.9, 3.1, 20.0])
"""Imaginary rates [1/s], the first as good as 0."""
MEASURED = ("position", "velocity", "acceleration")


def second(s, frequency, damping):
    """An oscillator of unit static gain, of whose mass and spring: m = 1/(2 π f)², k = 1."""
    mass = (2 * np.pi * frequency) ** -2
    return 1 / (mass * s**2 + 2 * damping * np.sqrt(mass) * s + 1)


def filtered(k, s):
    """One of the filters, by its polynomials."""
    pair, corner, zero = (2 * np.pi * np.array(f)[k] for f in ((2, 3), (2.5, 4.0), (9.0, 6.0)))
    zeta, xi = ((0.3, 0.5)[k], (0.4, 0.0)[k])
    zeros = zero**2 + 2 * xi * zero * s + s**2
    poles = (corner + s) * (pair**2 + 2 * zeta * pair * s + s**2)
    return corner * pair**2 / zero**2 * zeros / poles


def modal(power, weights, s, direct=0.0):
    """A sum of modes of 2 and 5 Hz by their weights."""
    both = zip(weights, (2.0, 5.0), (0.05, 0.03), strict=True)
    return direct + s**power * sum(w * second(s, f, z) for w, f, z in both)


SHARES = (0.6, -1.7)
OSCILLATORS = {m: Oscillator(0.5, 3.0, 0.08, m) for m in MEASURED}  # type: ignore[arg-type]
MODES = {
    m: set_values(
        Modes((1.0, -0.4), (2.0, 5.0), (0.05, 0.03), m),  # type: ignore[arg-type]
        {"joint": np.array(SHARES), "direct": 0.3},
    )
    for m in MEASURED
}
FILTERS = Filters(0.5, (2.0, 3.0), (0.3, 0.5), (2.5, 4.0), (9.0, 6.0), (0.4, 0.0))
# By machine: the response to its drive, and by port the response to what acts there, and the
# position to the drive and to what acts there.
FORMS: dict[str, tuple[AbstractMachine, Callable, dict[str, tuple[Callable, ...]]]] = {}
for _power, _name in enumerate(MEASURED):
    FORMS[f"oscillator's {_name}"] = (
        OSCILLATORS[_name],
        lambda s, q=_power: 0.5 * s**q * second(s, 3.0, 0.08),
        {"spring": (
            lambda s, q=_power: 0.5 * s**q * second(s, 3.0, 0.08),
            lambda s: 0.5 * second(s, 3.0, 0.08),
            lambda s: 0.5 * second(s, 3.0, 0.08),
        )},
    )  # fmt: skip
    FORMS[f"modes' {_name}"] = (
        MODES[_name],
        lambda s, q=_power: modal(q, (1.0, -0.4), s, 0.3),
        {"joint": (
            lambda s, q=_power: modal(q, (1.0 * SHARES[0], -0.4 * SHARES[1]), s),
            lambda s: modal(0, SHARES, s),
            lambda s: modal(0, np.square(SHARES), s),
        )},
    )  # fmt: skip
for _of_velocity in (False, True):
    FORMS[f"mass {_of_velocity}"] = (
        Mass(2.0, 0.7, of_velocity=_of_velocity),
        lambda s, q=_of_velocity: 2.0 * s**q / (s**2 + 0.7 * s),
        {"guide": (
            lambda s, q=_of_velocity: 2.0 * s**q / (s**2 + 0.7 * s),
            lambda s: 2.0 / (s**2 + 0.7 * s),
            lambda s: 2.0 / (s**2 + 0.7 * s),
        )},
    )  # fmt: skip
FORMS["one store"] = (
    Lag(0.8, (0.4,)),
    lambda s: 0.8 / (1 + 0.4 * s),
    {"outflow": 3 * (lambda s: 0.8 / (1 + 0.4 * s),)},
)
FORMS["two stores"] = (
    Lag(0.8, (0.4, 1.1)),
    lambda s: 2.2 / ((1 + 0.4 * s) * (1 + 1.1 * s)),
    {
        # What enters the first store is taken from the second.
        "outflow": (
            lambda s: 2.2 / (1 + 1.1 * s) * (1 / (1 + 0.4 * s) - 1),
            lambda s: 0.8 / (1 + 0.4 * s),
            lambda s: 0.8 / (1 + 0.4 * s),
        ),
        "last": (
            lambda s: 2.2 / (1 + 1.1 * s),
            lambda s: 2.2 / ((1 + 0.4 * s) * (1 + 1.1 * s)),
            lambda s: 2.2 / (1 + 1.1 * s),
        ),
    },
)
FORMS["filters"] = (
    FILTERS,
    lambda s: 0.5 * filtered(0, s) * filtered(1, s),
    {"between": (
        lambda s: 0.5 * filtered(1, s), lambda s: 0.5 * filtered(0, s), lambda s: 0 * s,
    )},
)  # fmt: skip
NAMES = [*FORMS]


def of_system(machine: AbstractMachine) -> tuple[np.ndarray, ...]:
    """A, B, C and D from drive and ports to response, positions and velocities."""
    a, b, c, d = (np.asarray(part, float) for part in machine.system())
    ports = machine.ports().values()
    enters = np.stack([b, *(np.asarray(port.enters) for port in ports)], axis=1)
    seen = [c, *(port.position for port in ports), *(port.velocity for port in ports)]
    direct = np.zeros((len(seen), enters.shape[1]))
    direct[0] = np.array([d, *(np.asarray(port.direct) for port in ports)])
    return a, enters, np.stack(seen), direct

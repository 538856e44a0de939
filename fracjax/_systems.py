r"""Rational transfer functions as state spaces, and the Laplace variable s that they are made of.

    ẋ = A x + b u,   y = c x + d u,     G(s) = c (s - A)^-1 b + d

Sums, products and reciprocals of such systems are such systems again, and no polynomial is formed.
A fractional power of s is Oustaloup's filter on a band [ω_b, ω_h]; an integer power n > 0 is a
product of n differentiators with poles beyond ω_h.  A block's symbol, called with a
`Variable`, thus becomes the block's rational transfer function.
"""

from __future__ import annotations

from itertools import count

import numpy as np

from ._blocks import (
    AbstractLinearBlock,
    Gain,
    Inverse,
    LinearParallel,
    LinearSeries,
    LogarithmicCreep,
    QuasiStaticForce,
)
from ._blocks.creep import _NODES, _WEIGHTS
from ._operators import oustaloup
from ._recording import InputError

_PAIRS_PER_DECADE = 3
"""Poles, each with a zero, per decade of Oustaloup's filter; chosen by judgement."""
_WIDENING = 1.07
"""Each further filter's band is wider by this factor, so that no two share a pole; by judgement."""
_REACH, _SPACING = 10.0, 1.5
"""A differentiator's pole lies at this factor beyond the band, and each further one at this factor
beyond the last; chosen by judgement."""


class Band:
    """Angular frequencies [rad/s] between which powers of s are approximated.

    The band of each power is a little wider than that of the last one, so that no two filters share
    a pole: partial fractions with simple poles have no term for a double one.  Derivatives roll off
    beyond `roll_off`, by default ten times the band's upper end.
    """

    def __init__(self, low: float, high: float, roll_off: float | None = None):
        self.low, self.high = low, high
        self.roll_off = _REACH * high if roll_off is None else roll_off
        self._turns = count()

    def power(self, order: float) -> System:
        """The system of s^order, for any order above -1."""
        whole = int(order)
        if whole < 0:
            raise _unsupported("a power of s below -1")
        system = System.constant(1.0)
        if order != whole:
            wider = _WIDENING ** next(self._turns)
            number = int(np.ceil(_PAIRS_PER_DECADE * np.log10(self.high / self.low) / 2))
            edges = self.low / wider, self.high * wider
            filtered = oustaloup(order - whole, *edges, number)
            system = System.parallel(-filtered.poles, filtered.residues(), filtered.gain)
        for _ in range(whole):
            pole = self.roll_off * _SPACING ** next(self._turns)
            system = system * _differentiator(pole, _SPACING**0.5 * pole)
        return system


class System:
    """A rational transfer function c (s - A)^-1 b + d: A (n, n) [1/s], b (n,), c (n,) and d."""

    __array_ufunc__ = None  # NumPy leaves `array * system` to this class

    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: float):
        self.a, self.b, self.c, self.d = a, b, c, float(d)

    @classmethod
    def constant(cls, gain: float) -> System:
        """A gain, without states."""
        return cls(np.zeros((0, 0)), np.zeros(0), np.zeros(0), gain)

    @classmethod
    def parallel(cls, poles: np.ndarray, residues: np.ndarray, direct: float) -> System:
        """direct + Σ residues/(s - poles)."""
        # b and c have equal sizes, which keeps the eigenvalues of products well conditioned.
        root = np.sqrt(np.abs(residues))
        return cls(np.diag(poles), root, np.sign(residues) * root, direct)

    def reciprocal(self) -> System:
        """The system of 1/G(s), for d ≠ 0."""
        gain = 1 / self.d
        return System(self.a - gain * np.outer(self.b, self.c), gain * self.b, -gain * self.c, gain)

    def __add__(self, other: Term) -> System:
        two = as_system(other)
        return System(
            _corner(self.a, two.a, np.zeros((self.b.size, two.b.size))),
            np.concatenate([self.b, two.b]),
            np.concatenate([self.c, two.c]),
            self.d + two.d,
        )

    def __mul__(self, other: Term) -> System:
        two = as_system(other)
        return System(
            _corner(self.a, two.a, np.outer(self.b, two.c)),
            np.concatenate([self.b * two.d, two.b]),
            np.concatenate([self.c, self.d * two.c]),
            self.d * two.d,
        )

    def __truediv__(self, other: Term) -> System:
        return self * as_system(other).reciprocal()

    def __rtruediv__(self, other: Term) -> System:
        return self.reciprocal() * other

    __radd__, __rmul__ = __add__, __mul__

    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Poles and residues (n,) of Σ residues/(s - poles) + d."""
        poles, vectors = np.linalg.eig(self.a)
        return poles, (self.c @ vectors) * np.linalg.solve(vectors, self.b)

    def at(self, s: np.ndarray) -> np.ndarray:
        """G (F,) at complex s (F,) [1/s], by solving."""
        size = np.eye(self.b.size)
        return np.array([self.c @ np.linalg.solve(x * size - self.a, self.b) + self.d for x in s])


class Variable:
    """gain · s^order, a power of s that becomes a system on its band where it is added."""

    __array_ufunc__ = None

    def __init__(self, band: Band, order: float = 1.0, gain: float = 1.0):
        self.band, self.order, self.gain = band, order, gain

    def system(self) -> System:
        """The power of s as a system on the band."""
        return self.band.power(self.order) * self.gain

    def __pow__(self, exponent: float) -> Variable:
        exponent = float(exponent)
        return Variable(self.band, self.order * exponent, self.gain**exponent)

    def __neg__(self) -> Variable:
        return Variable(self.band, self.order, -self.gain)

    def __mul__(self, other: Term) -> Variable | System:
        if isinstance(other, Variable):
            return Variable(self.band, self.order + other.order, self.gain * other.gain)
        if isinstance(other, System):
            return self.system() * other
        return Variable(self.band, self.order, self.gain * float(other))

    def __truediv__(self, other: Term) -> Variable | System:
        if isinstance(other, System):
            return self.system() / other
        return self * (other**-1 if isinstance(other, Variable) else 1 / float(other))

    def __rtruediv__(self, other: float) -> Variable | System:
        return self**-1 * other

    def __add__(self, other: Term) -> System:
        return self.system() + other

    __radd__, __rmul__ = __add__, __mul__


Term = System | Variable | float


def as_system(term: Term) -> System:
    """A system, a power of s or a number as a system."""
    if isinstance(term, System):
        return term
    return term.system() if isinstance(term, Variable) else System.constant(float(term))


def _differentiator(p: float, q: float) -> System:
    """s (1 + s (1/p + 1/q)) / ((1 + s/p) (1 + s/q)), which is s up to a term of third order."""
    poles = -np.array([p, q])
    residues = poles * (p * q + (p + q) * poles) / (poles - poles[::-1])
    return System.parallel(poles, residues, p + q)


def _corner(one: np.ndarray, two: np.ndarray, joint: np.ndarray) -> np.ndarray:
    """The block matrix [[one, joint], [0, two]]."""
    return np.block([[one, joint], [np.zeros((len(two), len(one))), two]])


def rational(block: AbstractLinearBlock, band: Band) -> System:
    """The rational transfer function that approximates a block on a band.

    Raises InputError when the block's transfer function is not made of powers of s.
    """
    match block:
        case LinearSeries():
            return rational(block.first, band) * rational(block.second, band)
        case LinearParallel():
            return rational(block.first, band) + rational(block.second, band)
        case Inverse():
            return rational(block.block, band).reciprocal()
        case QuasiStaticForce():
            return System.constant(float(block.stiffness.value))
        case Gain():
            return System.constant(float(block.k.value))
        case LogarithmicCreep():
            # It is defined as a sum of relaxations, which are its partial fractions.
            poles, share = _NODES / block.onset.value, block.gamma.value / np.log(10)
            return System.parallel(-poles, share * _WEIGHTS / block.onset.value, 1.0)
    try:
        return as_system(block.symbol(Variable(band)))  # type: ignore[arg-type]
    except TypeError:
        raise _unsupported(type(block).__name__) from None


def _unsupported(actual: str) -> InputError:
    """The error for a block that has no rational transfer function."""
    return InputError.at(
        "rational transfer function",
        "a model made of sums, products and powers of s above -1",
        actual,
        "for a drive use compensate, for a response simulate",
    )

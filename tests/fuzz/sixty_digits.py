"""Norms, poles and certificates once more, in fractions and with sixty digits and more.

Nothing of the package's own arithmetic is used: matrices are taken as fractions, loops are closed
in fractions, poles are the roots of the characteristic polynomial, and whether a gain is reached
is read off the real roots of the characteristic polynomial of the Hamiltonian matrix.
"""

import math
from contextlib import contextmanager
from functools import cached_property

import flint
import mpmath
import numpy as np
from flint import acb, acb_mat, arb, arb_mat, fmpq, fmpq_mat, fmpz_poly

import robustpolish as rp

DIGITS = 60
BITS = 400
# Largest loop that is looked at; its Hamiltonian has twice as many rows.
MOST_STATES = 14
# Claims are doubles: of what is exactly true, rounding to the nearest takes this much.
ROUNDING = 1e-12
# How far, relative, the gain at a claimed peak may lie below the gain that is claimed there.
PEAK = 1e-6


class FalsehoodError(Exception):
    """A result that sixty digits refute, or that is no number."""


class ExactSystem:
    """A system in fractions; a discrete one by s = (z - 1) / (z + 1), which keeps its gains."""

    def __init__(self, A, B, C, D, sampled=None):
        self.A, self.B, self.C, self.D = A, B, C, D
        self.sampled = sampled  # C, D and the sampling time of a discrete one

    @classmethod
    def of(cls, system):
        """Read a system of python-control."""
        n, m, p = system.nstates, system.ninputs, system.noutputs
        shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        A, B, C, D = (_fractions(np.reshape(getattr(system, k), s)) for k, s in shapes.items())
        if not system.dt:
            return cls(A, B, C, D)
        inverse = (A + _eye(n)).inv()
        image = inverse * (A - _eye(n)), inverse * B * 2, C * inverse, D - C * inverse * B
        return cls(*image, (C, D, system.dt))

    @classmethod
    def loop(cls, plant, K):
        """Close u = K y around a generalised plant; None if that is not well posed."""
        own = cls.of(K)
        A, B1, B2 = (_fractions(M) for M in (plant.A, plant.B1, plant.B2))
        C1, D11, D12 = (_fractions(M) for M in (plant.C1, plant.D11, plant.D12))
        C2, D21, D22 = (_fractions(M) for M in (plant.C2, plant.D21, plant.D22))
        well = _eye(plant.nu) - own.D * D22
        if plant.nu and well.det() == 0:
            return None
        back = well.inv() if plant.nu else well
        x, k, w = back * own.D * C2, back * own.C, back * own.D * D21
        into_k = _blocks([[own.B * (C2 + D22 * x), own.A + own.B * D22 * k]])
        return cls(
            _blocks([[_blocks([[A + B2 * x, B2 * k]])], [into_k]]),
            _blocks([[B1 + B2 * w], [own.B * (D21 + D22 * w)]]),
            _blocks([[C1 + D12 * x, D12 * k]]),
            D11 + D12 * w,
        )

    @property
    def states(self):
        """Their number."""
        return self.A.nrows()

    @cached_property
    def verdict(self):
        """Stable, marginal or unstable, by the roots of the characteristic polynomial."""
        if not self.states:
            return "stable"
        polynomial = self.A.charpoly().numer()
        # Entries of 1e-160 move poles by as little: balls that hold zero are looked at again.
        for bits in (BITS, 10 * BITS):
            with _bits(bits):
                reals = [root.real for root, _ in _roots(polynomial)]
                if any(real > 0 for real in reals):
                    return "unstable"
                if all(real < 0 for real in reals):
                    return "stable"
        return "marginal"

    def image(self, omega):
        """The frequency at which this one, in rad/s, stands here."""
        if self.sampled is None or math.isinf(omega):
            return omega
        return abs(math.tan(omega * self.sampled[2] / 2))

    def gain(self, omega):
        """The largest singular value at a frequency in rad/s, as a number of sixty digits."""
        if not (self.B.ncols() and self.C.nrows()):
            return mpmath.mpf(0)
        with _bits(BITS):
            response = acb_mat(self.D)
            if math.isfinite(omega) and self.states:
                shifted = -acb_mat(self.A)
                for i in range(self.states):
                    shifted[i, i] += acb(0, omega)
                try:
                    response += acb_mat(self.C) * shifted.solve(acb_mat(self.B))
                except ZeroDivisionError:
                    return mpmath.inf
            with mpmath.workdps(DIGITS):
                entries = [[_number(entry) for entry in row] for row in response.tolist()]
                return max(mpmath.svd_c(mpmath.matrix(entries), compute_uv=False))

    def exceeds(self, gamma):
        """Whether the gain of a stable system crosses `gamma` (a float) at some frequency."""
        if not (self.B.ncols() and self.C.nrows()):
            return gamma < 0
        g = fmpq(*float(gamma).as_integer_ratio())
        if self.gain(math.inf) > gamma or self.gain(0.0) > gamma:
            return True
        gap = _eye(self.B.ncols()) * g * g - self.D.transpose() * self.D
        if not self.states or gap.det() == 0:
            return False  # at the gain of D itself the end of the axis decides
        inverse, Dt = gap.inv(), self.D.transpose()
        own = self.A + self.B * inverse * Dt * self.C
        outer = _eye(self.C.nrows()) + self.D * inverse * Dt
        H = _blocks(
            [
                [own, self.B * inverse * self.B.transpose()],
                [-(self.C.transpose() * outer * self.C), -own.transpose()],
            ]
        )
        even = H.charpoly().numer().coeffs()[::2]
        # With s^2 = -x the polynomial changes its sign where a singular value crosses gamma.
        crossing = fmpz_poly([c if k % 2 == 0 else -c for k, c in enumerate(even)])
        return any(
            root.imag == 0 and root.real > 0 and times % 2 for root, times in _roots(crossing)
        )

    def h2(self):
        """The H2 norm of a stable system, without D if it is continuous, as a ball."""
        n = self.states
        if not (n and self.B.ncols() and self.C.nrows()):
            return arb(0)
        with _bits(4 * BITS):
            A, BB = arb_mat(self.A), arb_mat(self.B * self.B.transpose())
            whole = arb_mat(n * n, n * n)
            for i in range(n):
                for j in range(n):
                    for k in range(n):
                        whole[i * n + j, k * n + j] += A[i, k]
                        whole[i * n + j, i * n + k] += A[j, k]
            X = whole.solve(arb_mat(n * n, 1, [-entry for entry in BB.entries()]))
            X = arb_mat(n, n, X.entries())
            if self.sampled is None:
                return ((arb_mat(self.C) * X * arb_mat(self.C.transpose())).trace()).sqrt()
            C, D, _ = self.sampled  # the Gramian of the image is twice that of the samples
            each = arb_mat(C) * X * arb_mat(C.transpose()) / 2 + arb_mat(D * D.transpose())
            return each.trace().sqrt()


def checked(name, found, given):
    """Return a word for a result: "proven" where sixty digits looked at it.

    Raises
    ------
    FalsehoodError
        If they refute it, or a number of it is nan.
    """
    if isinstance(found, rp.results.HinfNorm):
        return _hinf(found, given.system)
    if isinstance(found, rp.results.H2Norm):
        return _h2(found, given.system)
    if isinstance(found, rp.results.Stability):
        return _stability(found, given.system)
    if isinstance(found, rp.results.Certificate):
        return certificate(found, given.plant, given.controller)
    if isinstance(found, rp.results.Design):
        return design(found)
    return "result"


def design(found):
    """Check the certificate of a design, which holds plant and controller."""
    plant = found.plant
    if (found.controller.noutputs, found.controller.ninputs) != (plant.nu, plant.ny):
        plant = plant.with_full_state()
    lower = found.lower_bound
    if lower is not None and not lower <= found.certificate.bound * (1 + ROUNDING):
        raise FalsehoodError(f"lower bound {lower} above the proven {found.certificate.bound}")
    return certificate(found.certificate, plant, found.controller)


def certificate(found, plant, K):
    """Check a certificate against plant and controller."""
    if not found.valid or plant.is_discrete or plant.delays:
        return "result"
    if plant.nx + K.nstates > MOST_STATES:
        return "large"
    loop = ExactSystem.loop(plant, K)
    if loop is None or loop.verdict != "stable":
        raise FalsehoodError("certified as stable, which it is not")
    if found.norm == "h2":
        true = loop.h2()
        if true > found.bound * (1 + ROUNDING) or any(loop.D.entries()):
            raise FalsehoodError(f"H2 norm {true} above the proven bound {found.bound}")
        return "proven"
    _bounded(loop, found.bound)
    # A norm of rounded matrices, at most 1 % larger, may stand for the exact one. What rounding
    # hides is said to be the proven bound itself: that it is reached nobody claims.
    if found.peak_frequency is not None and 0 < found.achieved < found.bound:
        _reached(loop, 0.99 * found.achieved, found.peak_frequency)
    return "proven"


def _hinf(found, system):
    exact = ExactSystem.of(system)
    if math.isnan(found.value) or not found.lower <= found.value <= found.upper:
        raise FalsehoodError(f"norm {found.lower}, {found.value}, {found.upper}")
    if exact.states > MOST_STATES:
        return "large"
    if found.stable != (exact.verdict == "stable"):
        raise FalsehoodError(f"stable: {found.stable}, the poles say {exact.verdict}")
    if not found.stable:
        return "result"
    if "proof" in found.reason or exact.states == 0:
        _bounded(exact, found.upper)
    _reached(exact, found.lower, found.frequency)
    return "proven"


def _h2(found, system):
    exact = ExactSystem.of(system)
    if math.isnan(found.value) or not found.lower <= found.value <= found.upper:
        raise FalsehoodError(f"norm {found.lower}, {found.value}, {found.upper}")
    if found.stable != (exact.verdict == "stable"):
        raise FalsehoodError(f"stable: {found.stable}, the poles say {exact.verdict}")
    if not found.stable:
        return "result"
    if exact.sampled is None and any(exact.D.entries()):
        if math.isfinite(found.value):
            raise FalsehoodError("a finite H2 norm in spite of D")
        return "result"
    true = exact.h2()
    if true > found.upper * (1 + ROUNDING) or true < found.lower * (1 - ROUNDING):
        raise FalsehoodError(f"H2 norm {true} outside of {found.lower} to {found.upper}")
    return "proven"


def _stability(found, system):
    exact = ExactSystem.of(system)
    if found.verdict != exact.verdict:
        raise FalsehoodError(f"{found.verdict}, the poles say {exact.verdict}")
    return "proven"


def _bounded(system, upper):
    if math.isfinite(upper) and system.exceeds(upper * (1 + ROUNDING)):
        raise FalsehoodError(f"the gain exceeds the proven bound {upper}")


def _reached(system, lower, frequency):
    if lower <= 0:
        return
    seen = 0.0 if math.isnan(frequency) else system.gain(system.image(frequency))
    # Rounding of the frequency alone may miss a sharp peak: is it reached anywhere?
    if seen < lower * (1 - PEAK) and not system.exceeds(lower * (1 - PEAK)):
        raise FalsehoodError(f"no gain of {lower} anywhere")


def _fractions(M):
    M = np.asarray(M, dtype=float)
    entries = [fmpq(*value.as_integer_ratio()) for value in M.ravel().tolist()]
    return fmpq_mat(*M.shape, entries)


def _eye(n):
    return fmpq_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def _blocks(rows):
    height = [line[0].nrows() for line in rows]
    width = [block.ncols() for block in rows[0]]
    whole = fmpq_mat(sum(height), sum(width))
    for a, line in enumerate(rows):
        for b, block in enumerate(line):
            for i in range(height[a]):
                for j in range(width[b]):
                    whole[sum(height[:a]) + i, sum(width[:b]) + j] = block[i, j]
    return whole


def _roots(polynomial):
    """Roots with multiplicities, isolated; those that are real or imaginary exactly so."""
    return polynomial.complex_roots() if polynomial.degree() > 0 else []


def _number(entry):
    return mpmath.mpc(*(mpmath.mpf(part.mid().str(DIGITS + 20, radius=False))
                        for part in (entry.real, entry.imag)))  # fmt: skip


@contextmanager
def _bits(bits):
    before, flint.ctx.prec = flint.ctx.prec, bits
    try:
        yield
    finally:
        flint.ctx.prec = before

"""A record seen through the observer of one level, the model's own errors taken out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from robustpolish.identification.candidates import Columns
from robustpolish.identification.linear_observer import LinearObserver
from robustpolish.identification.missing_force import Smoothed, known_forces
from robustpolish.identification.noise_colour import autoregression, resonates
from robustpolish.identification.nuisance import nuisance
from robustpolish.identification.observer import Level, Scales
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.simulation.signals import raw_outputs

Array = NDArray[np.float64]
ORDERS = (0, 1, 2, 4)


class Filtered:
    """Everything seen through the observer of one level."""

    def __init__(
        self, model: MechanicalModel, record: Record, level: Level, scales: Scales,
        motion: Smoothed, time: Array,
    ) -> None:  # fmt: skip
        self.level = level
        self.observer = LinearObserver(model, record.dt, level, scales)
        forces = known_forces(model, motion.q, motion.v, time, record.dt)
        Y = raw_outputs(model, record.Y, record.data["time"].values)
        _, errors = self.observer.innovations(Y, motion.inputs, forces)
        self.errors = errors
        self.sigma = np.ones(errors.shape[1])
        columns, self.ridge = nuisance(model, self.observer, motion, time, record.dt)
        self.raw = columns
        self.reweigh(np.std(errors[len(errors) // 20 :], axis=0))
        for _ in range(2):
            rest = self.residual(None)[0]
            self.reweigh(np.std(rest, axis=0))

    def reweigh(self, sigma: Array) -> None:
        """Weight the outputs and factor the nuisance columns."""
        self.sigma = np.where(sigma > 0, sigma, 1.0)
        N = (self.raw / self.sigma).reshape(len(self.raw), -1)
        size = np.sqrt(np.sum(N**2, axis=1))
        size[size == 0] = 1.0
        self.N = N / size[:, None]
        ridge = (self.ridge / size) ** 2
        # near-collinear start columns are held by a trace of ridge
        gram = self.N @ self.N.T + np.diag(ridge + 1e-9)
        self.factor = np.linalg.inv(gram)
        self.e = (self.errors / self.sigma).ravel()
        self.Ne = self.N @ self.e

    def weighted(self, columns: Array) -> Array:
        """Return columns (count, samples, ny) weighted and flattened."""
        return (columns / self.sigma).reshape(len(columns), -1)

    def residual(self, X: Array | None) -> tuple[Array, Array]:
        """Return the residual in the outputs' units and the coefficients of X."""
        if X is None:
            rest = self.e - self.N.T @ (self.factor @ self.Ne)
            return rest.reshape(self.errors.shape) * self.sigma, np.zeros(0)
        NX = self.N @ X.T
        projected = X @ X.T - NX.T @ self.factor @ NX
        target = X @ self.e - NX.T @ self.factor @ self.Ne
        size = np.sqrt(np.maximum(np.diag(X @ X.T), 1e-300))
        scaled = projected / np.outer(size, size)
        if np.any(np.diag(scaled) < 1e-4):  # hidden behind the model's own parameters
            return self.errors, np.full(len(X), np.nan)
        c = np.linalg.lstsq(scaled, target / size, rcond=1e-8)[0] / size
        beta = self.factor @ (self.Ne - NX @ c)
        rest = self.e - self.N.T @ beta - X.T @ c
        return rest.reshape(self.errors.shape) * self.sigma, c

    def respond(self, entry: Columns) -> Array:
        """Return the innovations that an entry's columns leave."""
        if entry.rows is None:
            return self.observer.respond_outputs(entry.values)
        return self.observer.respond(entry.rows, entry.pairs, entry.values)

    def scores(
        self, rest: Array, coefficients: int, orders: Sequence[int] = ORDERS
    ) -> dict[int, float]:
        """Return the information criterion for noise of several autoregressive orders."""
        samples, found = len(rest), {}
        if not np.isfinite(rest).all():
            return dict.fromkeys(orders, np.inf)
        for order in orders:
            total = 0.0
            for e in rest.T:
                a = autoregression(e, order)
                if resonates(a):
                    total = np.inf
                    break
                white = np.asarray(lfilter(a, [1.0], e)) if order else e
                total += samples * np.log(max(float(np.mean(white**2)), 1e-300))
            found[order] = total + (coefficients + order * rest.shape[1]) * np.log(samples)
        return found

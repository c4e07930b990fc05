"""A sampled loop simulated with 100 steps per sample, by means that the package does not use.

Plant, delay line, averaging sampler and controller are stepped as they are described; w is held
over each fine step, which makes every gain found here one that the loop has.
"""

import control
import numpy as np
from scipy import linalg

import robustpolish as rp

STEPS = 100


class FineLoop:
    """Matrices of one period: s+ = Phi s + Gamma w, z = Theta s + Lambda w in energy units."""

    def __init__(self, plant, controller, period, delay_steps):
        self.period, self.dt = period, period / STEPS
        P, K = plant, controller
        nx, nu, nw, nk, ny = P.nx, P.nu, P.nw, K.nstates, P.ny
        big = np.zeros((nx + nw + nu,) * 2)
        big[:nx] = np.hstack([P.A, P.B1, P.B2])
        see = np.hstack([P.C1, P.D11, P.D12])
        self.step = linalg.expm(big * self.dt)[:nx]
        self.root = _energy_root(big, see, self.dt)
        # s: x, mean of the noise, all controls on their way (newest first), the one acting, xk
        line = delay_steps // STEPS + 1
        self.sizes = (nx, ny, line * nu, nu, nk)
        n, m = sum(self.sizes), STEPS * nw
        start = np.hstack([np.eye(n), np.zeros((n, m))])
        w = np.hstack([np.zeros((m, n)), np.eye(m) / np.sqrt(self.dt)])
        after, out = self._period(P, K, start, w.reshape(STEPS, nw, n + m), delay_steps)
        self.Phi, self.Gamma = after[:, :n], after[:, n:]
        Theta, Lambda = out[:, :n], out[:, n:]
        self.see = Theta.T @ Theta, Theta.T @ Lambda, Lambda.T @ Lambda

    def _period(self, P, K, s, w, delay_steps):
        """Return the states after a period and the energies in it, of many runs at once."""
        x, mean, line, acting, xk = np.split(s, np.cumsum(self.sizes)[:-1])
        y = P.C2 @ x + mean + P.D22 @ acting
        u = K.C @ xk + K.D @ y
        xk = K.A @ xk + K.B @ y
        whole, rest = divmod(delay_steps, STEPS)
        queue = np.vstack([u, line])
        out = []
        mean = np.zeros_like(mean)
        for j in range(STEPS):
            if j == rest:
                acting = queue[whole * P.nu : (whole + 1) * P.nu]
            state = np.vstack([x, w[j], acting])
            out.append(self.root @ state)
            x = self.step @ state
            mean = mean + P.D21 @ w[j] / STEPS
        return np.vstack([x, mean, queue[: len(line)], acting, xk]), np.vstack(out)

    def gain_at(self, angle):
        """Largest gain of an input that turns by `angle` from period to period, and the input."""
        n = len(self.Phi)
        G = np.linalg.solve(np.exp(1j * angle) * np.eye(n) - self.Phi, self.Gamma)
        states, cross, direct = self.see
        mixed = G.conj().T @ cross
        values, vectors = np.linalg.eigh(G.conj().T @ states @ G + mixed + mixed.conj().T + direct)
        return np.sqrt(max(values[-1], 0.0)), vectors[:, -1]

    def largest_gain(self):
        """Search the worst angle; a lower bound of the norm."""
        poles = np.abs(np.angle(np.linalg.eigvals(self.Phi)))
        angles = np.unique(np.concatenate([poles, np.linspace(0, np.pi, 13)]))
        found = [self.gain_at(a)[0] for a in angles]
        i = int(np.argmax(found))
        low, high = angles[max(i - 1, 0)], angles[min(i + 1, len(angles) - 1)]
        for _ in range(3):
            near = np.linspace(low, high, 7)
            found = [self.gain_at(a)[0] for a in near]
            i = int(np.argmax(found))
            low, high = near[max(i - 1, 0)], near[min(i + 1, 6)]
        return found[i], near[i]

    def simulate(self, w):
        """Energy gain of a run from rest; w has one row per period."""
        states, cross, direct = self.see
        s, energy = np.zeros(len(self.Phi)), 0.0
        for row in np.vstack([w, np.zeros((200, w.shape[1]))]):
            energy += s @ states @ s + 2 * s @ cross @ row + row @ direct @ row
            s = self.Phi @ s + self.Gamma @ row
        return np.sqrt(energy / np.sum(w**2))


def _energy_root(big, see, dt):
    n = len(big)
    block = np.block([[-big.T, see.T @ see], [np.zeros((n, n)), big]]) * dt
    found = linalg.expm(block)
    Q = found[n:, n:].T @ found[:n, n:]
    values, vectors = np.linalg.eigh((Q + Q.T) / 2)
    return (vectors * np.sqrt(np.maximum(values, 0))).T


def random_loop(rng):
    """A random plant, a stabilising controller, a period and a delay in fine steps."""
    while True:
        n, nw, nu, nz, ny = rng.integers(1, 5), rng.integers(1, 3), rng.integers(1, 3), 2, 1
        A = rng.normal(size=(n, n)) - 0.5 * np.eye(n)
        D21 = rng.normal(size=(ny, nw)) * rng.integers(0, 2)
        D11 = rng.normal(size=(nz, nw)) * 0.3 * rng.integers(0, 2)
        plant = rp.GeneralizedPlant.from_matrices(
            A,
            rng.normal(size=(n, nw)),
            rng.normal(size=(n, nu)),
            rng.normal(size=(nz, n)),
            rng.normal(size=(ny, n)),
            D11=D11,
            D12=rng.normal(size=(nz, nu)),
            D21=D21,
            D22=rng.normal(size=(ny, nu)) * 0.1 * rng.integers(0, 2),
        )
        period = float(10 ** rng.uniform(-1.5, 0))
        nk = rng.integers(0, 3)
        K = control.StateSpace(
            rng.normal(size=(nk, nk)) * 0.3,
            rng.normal(size=(nk, ny)),
            rng.normal(size=(nu, nk)) * 0.3,
            rng.normal(size=(nu, ny)) * 0.5,
            period,
            remove_useless_states=False,
        )
        steps = int(rng.integers(0, 250)) * int(rng.integers(0, 2))
        loop = FineLoop(plant, K, period, steps)
        if np.abs(np.linalg.eigvals(loop.Phi)).max() < 0.97:
            return plant, K, period, steps, loop

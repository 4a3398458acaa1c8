"""A chain of rate-and-state blocks in numpy, which knows nothing of the program: the right-hand side for scipy and complex
arithmetic, steady sliding, eigenvalues."""
import numpy as np


class Chain:
    """A chain of rate-and-state friction (ageing) between free ends, with parameters of every block: psi, eta, ln theta."""

    def __init__(self, n, b, D=0.4, a=0.3, mu0=0.6, psi0=1.0, amplitude=1.0, v=0.5, k0=0.3, k1=0.7, zeta=0.1, m=1.0):
        self.n, self.k0, self.k1, self.zeta, self.v, self.mu0, self.psi0, self.m = n, k0, k1, zeta, v, mu0, psi0, m
        self.a, self.b, self.D, self.amplitude = (np.broadcast_to(np.asarray(x, float), n) for x in (a, b, D, amplitude))

    def force(self, psi, s):
        q = psi / (2 * self.psi0) * np.exp((self.mu0 + self.b * (np.log(self.psi0 / self.D) + s)) / self.a)
        return self.amplitude * self.a * np.arcsinh(q)

    def velocity(self, _t):
        """Of the plate."""
        return self.v

    def rhs(self, t, u):
        psi, eta, s = u.reshape(3, -1)
        coupling = np.zeros(self.n, u.dtype)
        coupling[1:] += psi[:-1] - psi[1:]
        coupling[:-1] += psi[1:] - psi[:-1]
        return np.concatenate([(eta - self.zeta * psi - self.force(psi, s)) / self.m,
                               self.k0 * (self.velocity(t) - psi) + self.k1 * coupling, np.exp(-s) - psi / self.D])

    def steady(self):
        psi, s = np.full(self.n, self.v), np.log(self.D / self.v)
        return np.concatenate([psi, self.zeta * psi + self.force(psi, s), s])

    def eigenvalues(self):
        # by a complex step: exact to round-off
        u, h = self.steady().astype(complex), 1e-30
        columns = [self.rhs(0, u + 1j * h * np.eye(len(u))[k]).imag / h for k in range(len(u))]
        return np.linalg.eigvals(np.array(columns).T)

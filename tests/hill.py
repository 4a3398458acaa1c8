"""Trains and their perturbations by Fourier collocation, for every law and state: dense matrices of numpy, built from
docs/model alone.

In the frame xi = t - x/V, one period T of (psi, eta[, s]) obeys R(u) = 0,

    R_psi = gamma (eta - F) - psi'
    R_eta = [v - psi + c^2 psi''/V^2]/gamma - s delta (eta - F) - eta'
    R_s   = g(psi, s) - s'

and the matrix of Hill is the derivative of R at the train, with d/dxi + i theta/T for d/dxi in a wave of Bloch factor
exp(i theta). The samples stand closer where the train is steep: equal steps of a smooth periodic function of the phase.
"""
import h5py
import numpy as np

from reference import DEFAULTS, Law


def fourier(n):
    """d/dsigma on n (odd) equal steps of [0, 1)."""
    k = np.arange(n)
    gap = k[:, None] - k[None, :]
    with np.errstate(divide="ignore"):
        D = np.pi * (-1.)**gap / np.sin(np.pi * gap / n)
    np.fill_diagonal(D, 0)
    return D


def one_pulse(path, summary):
    """Phases in [0, 1) and the unknowns there, s as it is integrated."""
    with h5py.File(path) as file:
        x, columns = file["x"][...] * summary["pulses"] / summary["length"], [file["psi"][...], file["eta"][...]]
        columns += [np.log(file[name][...]) if name == "theta" else file[name][...] for name in ("theta", "tau") if name in file]
    inside = x < 1 + 1e-12
    phase = x[inside] if summary["speed"] < 0 else 1 - x[inside]
    phase, first = np.unique(np.clip(phase, 0, 1), return_index=True)
    return phase[phase < 1], np.array([c[inside][first] for c in columns]).T[phase < 1]


class Train:
    """The train nearest to samples (phase rising in [0, 1), unknowns) of period T, on n points: u, period, residual."""

    def __init__(self, p, speed, phase, samples, period, n):
        p = self.p = DEFAULTS | p
        self.V, self.n, self.d, self.law = speed, n, samples.shape[1], Law(p)
        self.sd = p["model_delta"] * (-1 if p.get("model_delta_sign") == "printed" else 1)
        self.grade(phase, samples)
        u = np.array([np.interp(self.phase, np.append(phase, 1), np.append(column, column[0])) for column in samples.T])
        u, self.period = u.ravel(), period
        anchor, psi0 = 0, u[0]
        for _ in range(30):
            R, J = self.residual(u), self.matrix(u, 0)
            # T enters by d/dxi = D/T alone
            column = (self.residual(u, self.period * (1 + 1e-7)) - self.residual(u, self.period * (1 - 1e-7))) / 2e-7
            whole = np.zeros((len(u) + 1, len(u) + 1))
            whole[:-1, :-1], whole[:-1, -1], whole[-1, anchor] = J, column, 1
            step = np.linalg.solve(whole, -np.append(R, u[anchor] - psi0))
            u, self.period = u + step[:-1], self.period * np.exp(np.clip(step[-1], -.2, .2))
            if np.max(abs(step)) < 1e-11:
                break
        self.u, self.residual_left = u, np.max(abs(self.residual(u)))
        self.last_step = np.max(abs(step))

    def grade(self, phase, samples):
        """Steps as short as the train is steep, smoothed: sigma(phase) by a density, and d/dphase."""
        fine = np.linspace(0, 1, 4096, endpoint=False)
        values = [np.interp(fine, np.append(phase, 1), np.append(c, c[0])) for c in samples.T]
        steep = sum(abs(np.gradient(v, fine) / np.ptp(v)) for v in values)
        density = .35 + steep / np.mean(steep)
        modes = np.fft.rfft(density)
        modes *= np.exp(-(np.arange(len(modes)) / 24)**2)
        density = np.maximum(np.fft.irfft(modes), .2)
        modes = np.fft.rfft(density / np.mean(density))
        k = np.arange(len(modes))
        keep = (k > 0) & (k < 200)
        modes, k = modes / len(fine), k

        def sigma(x):
            return x + 2 * np.real(np.sum(modes[keep] / (2j * np.pi * k[keep]) * (np.exp(2j * np.pi * k[keep] * x[:, None]) - 1), axis=1))
        want, x = np.arange(self.n) / self.n, np.interp(np.arange(self.n) / self.n, sigma(fine), fine)

        def dens(x):
            return 1 + 2 * np.real(np.sum(modes[keep] * np.exp(2j * np.pi * k[keep] * x[:, None]), axis=1))
        for _ in range(50):
            x = x - (sigma(x) - want) / dens(x)
        self.phase, self.D = x, dens(x)[:, None] * fourier(self.n)

    def split(self, u):
        u = u.reshape(self.d, self.n)
        return u[0], u[1], (u[2] if self.d == 3 else np.zeros(self.n))

    def residual(self, u, period=None):
        p, D = self.p, self.D / (period or self.period)
        psi, eta, s = self.split(u)
        curve, F = D @ (D @ psi) / self.V**2, self.law.force(psi, s)
        gamma = p["model_gamma"]
        out = [gamma * (eta - F) - D @ psi,
               (p["model_v"] - psi + p["model_c"]**2 * curve) / gamma - self.sd * (eta - F) - D @ eta]
        if self.d == 3:
            out.append(self.law.rate(psi, s) - D @ s)
        return np.concatenate(out)

    def matrix(self, u, theta):
        """Hill's matrix for a Bloch factor exp(i theta)."""
        p, n, I = self.p, self.n, np.eye(self.n)
        psi, eta, s = self.split(u)
        D = self.D / self.period + (1j * theta / self.period * I if theta else 0)
        second = D @ D / self.V**2
        F_psi, F_s, g_psi, g_s = (np.diag(v) for v in self.law.slopes(psi, s))
        gamma, c2 = p["model_gamma"], p["model_c"]**2
        rows = [[-gamma * F_psi - D, gamma * I, -gamma * F_s],
                [(c2 * second - I) / gamma + self.sd * F_psi, -self.sd * I - D, self.sd * F_s]]
        if self.d == 3:
            rows.append([g_psi, 0 * I, g_s - D])
        return np.block([row[:self.d] for row in rows])

    def eigenvalues(self, theta):
        return np.linalg.eigvals(self.matrix(self.u, theta))


def agreed(one, other, tolerance):
    """Eigenvalues of one list that the other has too."""
    return np.array([z for z in one if np.min(abs(other - z)) < tolerance])

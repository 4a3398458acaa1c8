"""Two blocks with exact stick, and their tangent vectors, by scipy: independent of the program.

psi_i' = e_i - a_i F(psi_i), e_i = eta_i + nu (psi_j - psi_i), eta_i' = k0 (v - psi_i) + k1 (psi_j - psi_i); F = sgn(psi)/(1 + 2 alpha |psi|), threshold a_i of e_i;
m = f0 = 1, free ends. Between starts and stops solve_ivp with events; a deviation y passes an event g = 0 as
y + (f' - f) (grad g . y)/(grad g . f).
"""
import numpy as np
from scipy.integrate import solve_ivp


class TwoBlocks:
    def __init__(self, k0, k1, v, alpha, a, nu=0):
        self.k0, self.k1, self.v, self.a, self.nu = k0, k1, v, np.array(a, float), nu
        self.alpha = np.broadcast_to(np.asarray(alpha, float), 2)

    def force(self, u):
        return u[2:4] + self.nu * (u[1::-1] - u[:2])

    def rates(self, u, going):
        psi = u[:2]
        slide = np.where(going == 0, 0, self.force(u) - self.a * going / (1 + 2 * self.alpha * going * psi))
        return np.r_[slide, self.k0 * (self.v - psi) + self.k1 * (psi[::-1] - psi)]

    def jacobian(self, u, going):
        J = np.zeros((4, 4))
        for i in np.flatnonzero(going):
            J[i, 2 + i] = 1
            J[i, i] = 2 * self.alpha[i] * self.a[i] / (1 + 2 * self.alpha[i] * going[i] * u[i])**2 - self.nu
            J[i, 1 - i] = self.nu
        J[2, 0] = J[3, 1] = -self.k0 - self.k1
        J[2, 1] = J[3, 0] = self.k1
        return J

    def events(self, going):
        for i in (0, 1):
            if going[i]:
                event = lambda t, z, i=i: going[i] * z[i] + (1e-14 if z[i] == 0 else 0)  # noqa: E731
                event.direction = -1
            else:
                event = lambda t, z, i=i: abs(self.force(z[:4])[i]) - self.a[i]  # noqa: E731
                event.direction = 1
            event.terminal = True
            yield event

    def slide(self, u, Y, going, t):
        """To the next start or stop, or over the time t: state, vectors, time taken, the block (None)."""
        k = Y.shape[1]

        def rhs(_, z):
            return np.r_[self.rates(z[:4], going), (self.jacobian(z[:4], going) @ z[4:].reshape(4, k)).ravel()]

        run = solve_ivp(rhs, (0, t), np.r_[u, Y.ravel()], events=list(self.events(going)), method="DOP853", rtol=1e-9,
                        atol=1e-11, max_step=4)
        hit = [i for i in (0, 1) if len(run.t_events[i])]
        return run.y[:4, -1], run.y[4:, -1].reshape(4, k), run.t[-1], hit[0] if hit else None

    def start(self, u):
        going = np.sign(u[:2])
        for i in (0, 1):
            force, rate = self.force(u)[i], self.force(self.rates(u, going))[i]
            if going[i] == 0 and abs(force) >= self.a[i] * (1 - 1e-12) and rate * np.sign(force) > 0:
                going[i] = np.sign(force)
        return going

    def follow(self, u, Y, time, vectors_after=None):
        """Over that time. With `vectors_after`, a function of (t, Y), what it returns goes on after each event."""
        u, Y, t = np.array(u, float), np.array(Y, float), 0.0
        going = self.start(u)
        Y[:2][going == 0] = 0
        while t < time:
            if not going.any():
                rate = self.rates(u, going)[2:]
                wait = np.where(rate > 0, (self.a - u[2:]) / rate, np.inf)
                block, taken = int(np.argmin(wait)), float(min(wait.min(), time - t))
                u[2:] += rate * taken
                block = block if taken == wait.min() else None
            else:
                u, Y, taken, block = self.slide(u, Y, going, time - t)
            t += taken
            if block is None:
                break
            before, becomes = self.rates(u, going), going.copy()
            if going[block]:
                u[block], gradient = 0, np.eye(4)[block]
                force = self.force(u)[block]
                becomes[block] = np.sign(force) if abs(force) > self.a[block] else 0
            else:
                becomes[block] = np.sign(self.force(u)[block])
                gradient = becomes[block] * (np.eye(4)[2 + block] + self.nu * np.eye(4)[1 - block])  # its own psi is 0
            Y = Y + np.outer(self.rates(u, becomes) - before, gradient @ Y) / (gradient @ before)
            going = becomes
            if vectors_after:
                Y = vectors_after(t, Y)
        return u, Y

    def largest_exponent(self, u, time):
        logs = []

        def shorten(_, y):
            length = np.linalg.norm(y)
            logs.append(np.log(length))
            return y / length

        _, y = self.follow(u, np.array([[0.3], [0.1], [0.8], [-0.5]]), time, shorten)
        return (sum(logs) + np.log(np.linalg.norm(y))) / time

    def cycle(self, u, period):
        """How far a turn misses itself, and the magnitudes of the multipliers, largest first."""
        end, M = self.follow(u, np.eye(4), period)
        return np.abs(end - u).max(), np.sort(np.abs(np.linalg.eigvals(M)))[::-1]

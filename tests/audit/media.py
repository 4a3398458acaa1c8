"""Motions of the continuum in a spread medium, computed without the program.

psi alone obeys  psi_tt = c^2 psi_xx + v - psi - (delta + gamma a phi'(psi)) psi_t,  phi = psi^3/3 - psi. Leapfrog at the
step h/c carries the wave part exactly from node to node, and with it every corner of the medium and of the start that
lies on a node; what is left are errors in even powers of h, which extrapolation over three grids takes away. eta follows
from psi_t = gamma (eta - a phi).

The medium is data here, rebuilt from its description: a draw at every corner of a cell from a counter-based generator,
the quintic 10 s^3 - 15 s^4 + 6 s^5 between the corners."""
import numpy as np

M64 = (1 << 64) - 1


def mixed(z):
    z = (z + 0x9E3779B97F4A7C15) & M64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & M64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & M64
    return z ^ (z >> 31)


def uniform(seed, index):
    return ((mixed(mixed(seed) ^ (2 * index)) >> 11) + 0.5) * 2.0**-53


def amplitude(x, length, ring, spread, seed, cell_length):
    """a(x) of friction_spread, uniform kind."""
    cells = max(1, int(np.floor(length / cell_length + 0.5)))
    cell = length / cells if ring else cell_length
    draws = np.array([1 + spread * (2 * uniform(seed, k) - 1) for k in range(int(length / cell) + 3)])
    q = np.asarray(x) / cell
    corner = np.floor(q).astype(int)
    s = q - corner
    w = s**3 * (10 + s * (6 * s - 15))
    left, right = (corner % cells, (corner + 1) % cells) if ring else (corner, corner + 1)
    return (1 - w) * draws[left] + w * draws[right]


class Medium:
    """The continuum with the cubic law. left, right: None on a ring, "free", or the velocity of a held end."""

    def __init__(self, gamma, delta, c, v, length, spread=0, seed=1, cell_length=1, left=None, right=None):
        self.gamma, self.delta, self.c, self.v, self.length = gamma, delta, c, v, length
        self.medium = (spread, seed, cell_length)
        self.left, self.right = left, right

    @property
    def ring(self):
        return self.left is None

    def _leapfrog(self, psi0, eta0, t_end, parts):
        n = parts + (0 if self.ring else 1)
        h = self.length / parts
        dt = h / self.c
        steps = round(t_end / dt)
        assert abs(steps * dt - t_end) < 1e-9 * t_end
        x = h * np.arange(n)
        a = amplitude(x, self.length, self.ring, *self.medium) if self.medium[0] else np.ones(n)
        wide = np.empty(n + 2)

        def neighbours(psi):
            wide[1:-1] = psi
            wide[0], wide[-1] = (psi[-1], psi[0]) if self.ring else (psi[1], psi[-2])
            return wide[:-2] + wide[2:]

        def hold(psi):
            for end, node in ((self.left, 0), (self.right, -1)):
                if isinstance(end, float):
                    psi[node] = end
            return psi

        now = psi0(x) * np.ones(n)
        rate = self.gamma * (eta0(x, now, a) - a * now * (now * now / 3 - 1))
        drag = self.delta + self.gamma * a * (now * now - 1)
        after = hold((neighbours(now) + dt * dt * (self.v - now - drag * rate)) / 2 + dt * rate)
        before = after - 2 * dt * rate
        for _ in range(steps):
            before, now = now, after
            drag = dt / 2 * (self.delta + self.gamma * a * (now * now - 1))
            after = neighbours(now) + dt * dt * (self.v - now) - (1 - drag) * before
            after /= 1 + drag
            hold(after)
        rate = (after - before) / (2 * dt)  # of now, which is t_end
        return np.array([now, rate / self.gamma + a * now * (now * now / 3 - 1)])

    def solution(self, psi0, eta0, t_end, parts, finest):
        """psi, eta on the nodes of the coarsest of four grids, a multiple of `parts` and the finest at least `finest`
        parts; and the distance of the extrapolations of the first and of the last three. t_end: a multiple of
        length/(parts c)."""
        first = parts * max(1, round(finest / 8 / parts))
        grids = [self._leapfrog(psi0, eta0, t_end, first * 2**k)[:, ::2**k] for k in range(4)]

        def extrapolated(k):
            a, b, c = grids[k:k + 3]
            ab, bc = b + (b - a) / 3, c + (c - b) / 3
            return bc + (bc - ab) / 15
        return extrapolated(1), np.abs(extrapolated(1) - extrapolated(0)).max()

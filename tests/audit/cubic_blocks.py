"""A chain of blocks with the cubic law in numpy, which knows nothing of the program."""
import numpy as np


class Blocks:
    """psi and eta of every block, in a ring or between free ends, pulled at v."""

    def __init__(self, n, ring, k0, k1, zeta, m):
        self.n, self.ring, self.k0, self.k1, self.zeta, self.m = n, ring, k0, k1, zeta, m

    def options(self):
        return f"-model_form chain -grid_n {self.n} -model_k0 {self.k0} -model_k1 {self.k1} -model_zeta {self.zeta} -model_m {self.m} " + \
            ("-bc_left periodic" if self.ring else "-bc_left free -bc_right free") + " -scene_reduce off"

    def rhs(self, v, u):
        psi, eta = u[:self.n], u[self.n:]
        left, right = np.roll(psi, 1), np.roll(psi, -1)
        if not self.ring:
            left[0], right[-1] = psi[0], psi[-1]
        return np.concatenate([(eta - self.zeta * psi - (psi**3 / 3 - psi)) / self.m,
                               self.k0 * (v - psi) + self.k1 * (left + right - 2 * psi)])

"""A chain under a plate that halts (load_halt), integrated by SciPy from event to event: it shares no code with the program."""
import numpy as np
from scipy.integrate import solve_ivp


class HaltedChain:
    """Blocks with psi_t = A (eta - B psi - a phi(|psi|) sgn psi) and eta_t = -K0 psi + K1 D2 psi while any slips, eta_t = K0 v
    while none does; at rest up to the thresholds `limit`."""

    def __init__(self, eta, limit, kinetic, A=1.0, B=0.0, K0=1.0, K1=1.0, v=0.01, ring=False, back_slip=True):
        self.eta, self.limit, self.kinetic = np.array(eta, float), np.array(limit, float), kinetic
        self.A, self.B, self.K0, self.K1, self.v, self.back_slip = A, B, K0, K1, v, back_slip
        n = len(eta)
        self.D2 = np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
        if ring:
            self.D2[0, -1] += 1
            self.D2[-1, 0] += 1
        self.D2 -= np.diag(self.D2.sum(axis=1))
        self.plate = self.clock = 0.0
        self.chi = np.zeros(n)

    def events_until(self, plate_end):
        """Rows of plate's time, duration, first nodes, slips of all nodes."""
        rows, side = [], np.sign(self.v)
        while side > 0 or self.back_slip:
            waits = (self.limit - side * self.eta) / (self.K0 * abs(self.v))
            wait = max(waits.min(), 0)
            rests = min(wait, plate_end - self.plate)
            self.eta += self.K0 * self.v * rests
            self.plate += rests
            self.clock += rests
            if rests < wait:
                return rows
            first = waits <= waits.min() + 1e-11 / abs(self.v)
            self.eta[first] = side * self.limit[first]
            slip, duration = self.slips(np.where(first, side, 0))
            rows.append((self.plate, duration, np.flatnonzero(first), slip))
            self.clock += duration
            self.chi += slip
        return rows

    def slips(self, going):
        n, t = len(self.eta), 0.0
        psi, slip = np.zeros(n), np.zeros(n)
        while going.any():
            moves = going != 0

            def rates(_, y, moves=moves, going=going):
                psi, eta = y[:n] * moves, y[n:2 * n]
                force = going * self.kinetic(going * psi)
                return np.r_[self.A * (eta - self.B * psi - force) * moves, -self.K0 * psi + self.K1 * (self.D2 @ psi), psi]

            fresh = moves & (psi == 0)

            def stop(i, going=going, fresh=fresh):
                def value(t, y):  # what has just begun is at zero
                    return going[i] * y[i] + (1e-9 if fresh[i] and t < 1e-6 else 0)
                return value

            def start(i, sign):
                return lambda _, y: sign * y[n + i] - self.limit[i]

            watched = [(i, 0, stop(i)) for i in np.flatnonzero(moves)]
            watched += [(i, sign, start(i, sign)) for i in np.flatnonzero(~moves) for sign in ((1, -1) if self.back_slip else (1,))]
            for _, sign, function in watched:
                function.terminal, function.direction = True, 1 if sign else -1
            one = solve_ivp(rates, (0, 1e3), np.r_[psi, self.eta, slip], method="DOP853", rtol=1e-13, atol=1e-14,
                            events=[function for _, _, function in watched], max_step=0.2)
            assert one.status == 1, one.message
            t += one.t[-1]
            psi, self.eta, slip = one.y[:n, -1].copy(), one.y[n:2 * n, -1].copy(), one.y[2 * n:, -1].copy()
            going = going.copy()
            for (i, sign, _), times in zip(watched, one.t_events):
                if len(times) == 0:
                    continue
                if sign:
                    going[i] = sign
                    self.eta[i] = sign * self.limit[i]
                else:
                    psi[i] = 0
                    beyond = abs(self.eta[i]) > self.limit[i] and (self.back_slip or self.eta[i] > 0)
                    going[i] = np.sign(self.eta[i]) if beyond else 0
        return slip, t

"""Exact stick with viscosity between neighbours, under a load that varies: whole motions of a small chain against scipy,
which goes from start to stop by events; the time at which a block beside a moving end begins to slip in closed form."""
import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import check, data, run

LOAD = [(0, 0.6), (5, 0.1), (5, 0.0), (16, 0.0), (16, 0.7)]  # corners of v(t), constant after the last
K0, K1, NU, ZETA = 0.5, 0.8, 0.6, 0.1


def plate(t, piece):
    (a, low), (b, high) = LOAD[piece], LOAD[min(piece + 1, len(LOAD) - 1)]
    return low + (high - low) * (t - a) / (b - a) if b > a else low


class Blocks:
    """psi' = eta + nu D2 psi - zeta psi - sgn/(1 + |psi|), eta' = k0 (v(t) - psi) + k1 D2 psi between free ends; a block
    rests while |eta + nu D2 psi| <= 1. `going`: the direction of each, 0 at rest."""

    def __init__(self, n):
        self.n = n

    def d2(self, psi):
        wide = np.concatenate([psi[:1], psi, psi[-1:]])
        return wide[2:] - 2 * psi + wide[:-2]

    def force(self, u):
        return u[self.n:] + NU * self.d2(u[:self.n])

    def rates(self, t, u, going, piece):
        psi = u[:self.n]
        slide = np.where(going == 0, 0, self.force(u) - ZETA * psi - going / (1 + np.abs(psi)))
        return np.concatenate([slide, K0 * (plate(t, piece) - psi) + K1 * self.d2(psi)])

    def events(self, going):
        for i in range(self.n):
            if going[i]:
                event = lambda t, u, *_, i=i: going[i] * u[i] + (1e-14 if u[i] == 0 else 0)  # noqa: E731
                event.direction = -1
            else:
                event = lambda t, u, *_, i=i: abs(self.force(u)[i]) - 1  # noqa: E731
                event.direction = 1
            event.terminal = True
            yield event

    def follow(self, u, going, t, end, piece):
        """To the end, and the number of starts and stops."""
        turns = 0
        while t < end:
            course = solve_ivp(self.rates, (t, end), u, args=(going, piece), events=list(self.events(going)),
                               method="DOP853", rtol=1e-10, atol=1e-12, max_step=0.5)
            t, u = course.t[-1], course.y[:, -1]
            for i in range(self.n):
                if len(course.t_events[i]):
                    force, turns, going = self.force(u)[i], turns + 1, going.copy()
                    if going[i]:
                        u[i] = 0
                        going[i] = np.sign(force) if abs(force) > 1 else 0
                    else:
                        going[i] = np.sign(force)
                    break
        return u, going, turns


def test_motions_of_a_chain():
    n, times = 4, [0, 5, 10, 16, 24, 30]
    words = (f"-model_form chain -grid_n {n} -bc_left free -model_k0 {K0} -model_k1 {K1} -model_nu {NU} -model_zeta {ZETA}"
             " -friction_law carlson-langer -init_psi 0 -init_eta 0.4 -init_noise 0.5 -init_seed 3 -ts_max_time 30"
             " -ts_rtol 1e-10 -ts_atol 1e-11 -out_times " + ",".join(map(str, times)) + " -out_file s.h5 -load_v " +
             ",".join(f"{t}:{v}" for t, v in LOAD))
    run(words)
    found = data("s.h5")
    u = np.concatenate([found["psi"][0], found["eta"][0]])
    going, blocks, turns, rested = np.sign(u[:n]), Blocks(n), 0, False
    for k, (begin, end) in enumerate(zip(times, times[1:])):
        piece = max(i for i, (t, _) in enumerate(LOAD) if t <= begin)
        u, going, more = blocks.follow(u, going, begin, end, piece)
        turns, rested = turns + more, rested or not going.any()
        off = max(np.abs(found["psi"][k + 1] - u[:n]).max(), np.abs(found["eta"][k + 1] - u[n:]).max())
        # a place where a block grazes rest is met as the square root of the tolerance
        check(off < 1e-6, f"at {end} psi and eta are off by {off} after {turns} starts and stops")
    check(turns >= 8 and rested and going.any(), f"{turns} starts and stops, a rest of all and a start behind it: {rested}")


def test_release_beside_a_moving_end():
    # one block between an end held at 0.2 and a free one rests under K0 X(t) + k1 0.2 t + nu 0.2, until this is 1
    end = 0.2
    words = (f"-model_form chain -grid_n 2 -bc_left velocity -bc_left_value {end} -bc_right free -friction_law carlson-langer"
             f" -model_k0 {K0} -model_k1 0.01 -init_type layer -init_psi 0 -init_eta 0 -init_width 1e-3"
             " -ts_max_time 60 -out_file s.h5")
    for nu in (0, 1.5):
        def excess(t):
            return K0 * (0.05 * t + 0.3 * 2 / math.pi * math.sin(math.pi * t / 2)**2) + end * (0.01 * t + nu) - 1
        times = np.linspace(0, 60, 600001)
        first = next(t for t in times if excess(t) > 0)
        exact = brentq(excess, first - 1e-3, first)
        run(words + f" -model_nu {nu} -model_v 0.05 -load_sine_amplitude 0.3 -load_sine_period 2")
        found = data("s.h5")
        check(np.abs(found["series/t"] - exact).min() < 1e-9, f"a step ends where the block begins to slip: {exact}")
        moves = found["psi"][:, 1] != 0
        check(not moves[found["t"] <= exact].any() and moves[found["t"] > exact][:3].all(), f"nu {nu}: it rests until {exact}")

"""Exact stick with viscosity between neighbours, under a load that varies: whole motions of a small chain against scipy;
the time at which a block beside a moving end begins to slip in closed form."""
import math

import numpy as np
from scipy.optimize import brentq

from calls import check, data, run
from reference import Stick, System, read

K0 = 0.5


def test_motions_of_a_chain():
    n, times = 4, [0, 5, 10, 16, 24, 30]
    scene = (f"-model_form chain -grid_n {n} -bc_left free -model_k0 {K0} -model_k1 0.8 -model_nu 0.6 -model_zeta 0.1"
             " -friction_law carlson-langer -load_v 0:0.6,5:0.1,5:0.0,16:0.0,16:0.7")
    run(f"{scene} -init_psi 0 -init_eta 0.4 -init_noise 0.5 -init_seed 3 -ts_max_time 30 -ts_rtol 1e-10 -ts_atol 1e-11"
        f" -out_times {','.join(map(str, times))} -out_file s.h5")
    found = data("s.h5")
    motion, rested = Stick(System(scene), read(found, 0), rtol=1e-10, atol=1e-12), False
    for k, end in enumerate(times[1:], 1):
        off = np.abs(read(found, k) - motion.advance(end)).max()
        rested = rested or motion.rests.all()
        # a place where a block grazes rest is met as the square root of the tolerance
        check(off < 1e-6, f"at {end} psi and eta are off by {off} after {motion.changes} starts and stops")
    check(motion.changes >= 8 and rested and not motion.rests.all(),
          f"{motion.changes} starts and stops, a rest of all and a start behind it: {rested}")


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

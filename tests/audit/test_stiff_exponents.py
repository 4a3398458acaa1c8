"""Lyapunov exponents of stiff friction (rate and state, regularised stick) against Benettin's method with differences of
motions: the scene and nearby copies of it are integrated together by scipy (Radau), so that they share their steps, and
made orthonormal again at the times of the file's rows."""
import numpy as np
from scipy.integrate import solve_ivp

from calls import check, data, run
from reference import System, read, words

APART = 1e-8, 1e-7  # of the copies: as a rule; where they come so near to each other that round-off parts them


def draw(generator):
    """A block or two that stick and slip, and how many directions friction does not damp at once: with rate and state, at a
    stiffness below the critical one, two a block; one, its force, where stick is regularised."""
    if generator.random() < 0.3:
        return {"model_form": "chain", "grid_n": 1, "bc_left": "free", "model_v": generator.uniform(0.05, 0.3), "model_k0": 1.,
                "friction_law": str(generator.choice(["coulomb", "carlson-langer"])), "friction_stick": "regularised",
                "friction_eps": 10 ** generator.uniform(-4.5, -3), "init_psi": 0., "init_eta": 0.2, "ts_max_time": 60.}, 1
    n, a = int(generator.integers(1, 3)), generator.uniform(0.01, 0.03)
    b, D, v = a + generator.uniform(0.005, 0.02), 10 ** generator.uniform(-2.5, -1), 10 ** generator.uniform(-3, -1)
    critical = (b - a) / D
    p = {"model_form": "chain", "grid_n": n, "bc_left": "free", "model_v": v, "model_m": 10 ** generator.uniform(-3, -1),
         "model_k0": critical * generator.uniform(0.4, 0.9), "model_zeta": generator.choice([0, 0.05])}
    if n > 1:
        p |= {"model_k1": critical * generator.uniform(0.05, 0.5), "friction_amplitude": generator.uniform(0.9, 1.1, n)}
    p |= {"friction_law": "rate-and-state", "state_law": str(generator.choice(["ageing", "slip"])), "friction_a": a, "friction_b": b,
          "friction_D": D, "friction_psi0": v, "init_psi": v * generator.uniform(1.05, 1.3), "init_eta": "steady",
          "init_state": "steady", "ts_max_time": float(60 * D / v)}
    return p, 2 * n


def grown(system, u, times, count, generator, apart):
    """ln of what the volume of `count` differences grows by from each time to the next."""
    N = len(u)
    Y = np.linalg.qr(generator.normal(size=(N, count)))[0].T * np.maximum(np.abs(u), 1e-3 * np.abs(u).max())
    logs = []
    for begin, end in zip(times, times[1:]):
        copies = np.vstack([u, u + apart * Y, u - apart * Y])
        together = solve_ivp(lambda t, z: system.rates(t, z.reshape(-1, N)).ravel(), (begin, end), copies.ravel(), method="Radau",
                             rtol=1e-9, atol=1e-15, first_step=1e-9 * (end - begin))
        copies = together.y[:, -1].reshape(-1, N)
        u, moved = copies[0], (copies[1:count + 1] - copies[count + 1:]) / (2 * apart)
        Q, R = np.linalg.qr(moved.T)
        logs.append(np.log(np.abs(np.diag(R))).sum())
        Y = Q.T
    return np.array(logs), u


def test_volumes_grow_as_those_of_nearby_motions(scenes):
    """Round-off over their distance and the steps of Radau, which the copies share, leave the differences some 1e-5. The
    first two intervals turn the vectors to where friction leaves them."""
    for index, (p, count) in scenes(draw, salt=101, short=1):
        run(words(p) + ["-lyapunov_count", str(count), "-lyapunov_from", "0", "-ts_rtol", "1e-10", "-ts_atol", "1e-12",
                        "-out_file", "s.h5", "-out_frames", "257"])
        file = data("s.h5")
        t = np.r_[0, file["lyapunov/t"]]
        check(np.abs(t - file["t"]).max() <= 1e-9 * t[-1], "a frame at each row")
        rows = np.arange(96, 193, 2)
        growth = np.diff(t) * sum(file[f"lyapunov/rate_{k + 1}"] for k in range(count))
        found = np.add.reduceat(growth, rows)[:-1]
        def off(apart):
            expected, end = grown(System(p), read(file, rows[0]), t[rows], count, np.random.default_rng(index), apart)
            check(np.abs(end - read(file, rows[-1])).max() < 1e-5, f"{index} {p}: the same motion")
            return (np.abs(found - expected) / (1 + np.abs(expected)))[16:]
        gap = off(APART[0])
        if gap.max() > 5e-4:
            gap = np.minimum(gap, off(APART[1]))
        check(gap.max() < 5e-4, f"{index} {p}: {found} {gap}")

"""The steps that theory allows in a chart of limits, against R(z) of the method and the dispersion relation:
from which step on the shortest wave grows too fast (explicit methods), and from which on no wave of unstable
sliding grows (backward Euler); the trapezoidal rule hides nothing."""
import numpy as np
from scipy.optimize import brentq

from calls import run

STAGES = {"euler": ([[]], [1]), "rk:2a": ([[], [1]], [1 / 2, 1 / 2]),
          "rk:3bs": ([[], [1 / 2], [0, 3 / 4]], [2 / 9, 1 / 3, 4 / 9]),
          "rk:4": ([[], [1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])}
ALLOWED = 0.02  # growth of the shortest wave beyond its own, in units of its frequency


def draw(random):
    u, choice = random.uniform, random.choice
    ring, v = random.random() < 0.6, choice([-1, 1]) * 10 ** u(-0.7, 0)
    weakness = 10 ** u(-3, -0.5)  # by which friction weakens beyond what is damped
    p = {"grid_n": 2 * int(random.integers(5, 12)), "model_v": v, "init_type": "sine", "init_psi": v,
         "init_amplitude": 0.1, "ts_max_time": u(4, 8)}
    p |= {} if ring else {"bc_left": "free"}
    if random.random() < 0.5:
        p |= {"model_form": "chain", "model_m": u(0.5, 2), "model_k0": u(0.1, 1),
              "model_k1": u(0.2, 3), "model_f0": u(0.6, 1.6)}
        p["model_zeta"] = p["model_f0"] * max(0, 1 - v**2 - weakness)
    else:
        p |= {"grid_length": u(6, 25), "model_gamma": u(0.6, 3), "model_c": u(0.5, 2),
              "model_delta": u(0, 0.3), "grid_order": choice([2, 4, 6, 8])}
        if random.random() < 0.5:
            squared = 1 - (p["model_delta"] + weakness) / p["model_gamma"]
            p["model_v"] = np.sign(v) * np.sqrt(max(0.01, squared))
    if random.random() < 0.3:
        p["model_nu"] = u(0.005, 0.1)
    return p


def waves(p):
    """lambda of every wave that fits the scene, the shortest last, and that one's frequency."""
    n, ring, v = p["grid_n"], "bc_left" not in p, p["model_v"]
    if p.get("model_form") == "chain":
        f0, h, order = p["model_f0"], 1, 2
        A, sd = f0 / p["model_m"], 0
        B, K0, K1, N = (p.get("model_" + name, 0) / f0 for name in ("zeta", "k0", "k1", "nu"))
        angles = np.pi * np.arange(n) / n  # half of kh; a free chain has the waves of a ring of 2 n
        angles = np.pi * np.arange(n // 2 + 1) / n if ring else angles / 2
    else:
        A, B, sd, order = p["model_gamma"], 0, p["model_delta"], int(p["grid_order"])
        h = p["grid_length"] / (n if ring else n - 1)
        K0, K1, N = 1 / A, p["model_c"]**2 / A, p.get("model_nu", 0) / A
        angles = np.pi * np.arange(n // 2 + 1) / n if ring else np.pi / 2 * np.arange(n) / (n - 1)
    S = np.append(np.sin(angles)**2, 1)
    kappa2 = 4 / h**2 * sum(c * S**(k + 1) for k, c in enumerate([1, 1 / 3, 8 / 45, 4 / 35][:order // 2]))
    C = A * (B + v**2 - 1) + sd + A * N * kappa2
    root = np.sqrt(C**2 / 4 - A * (K0 + K1 * kappa2) + 0j)
    return np.array([-C / 2 + root, -C / 2 - root]), np.sqrt(A * (K0 + K1 * kappa2[-1]))


def R(method, z):
    slopes = []
    for row in STAGES[method][0]:
        slopes.append(z * (1 + sum(a * k for a, k in zip(row, slopes))))
    return 1 + sum(b * k for b, k in zip(STAGES[method][1], slopes))


def check(index, p):
    words = [word for name, value in p.items() for word in (f"-{name}", str(value))]
    words += ["-chart_kind", "limits", "-chart_methods", ",".join([*STAGES, "beuler", "cn"])]
    summary, _ = run(words, command="chart")
    values, frequency = waves(p)
    shortest, growth = values[:, -1], values.real.max()
    hidden = 0
    for row in summary["rows"]:
        text = f"scene {index}: {row['method']}: {' '.join(words)}: {row}"
        if row["method"] in STAGES:
            def excess(dt):
                rate = np.log(np.abs(R(row["method"], shortest * dt))).max() / dt
                return rate - shortest.real.max() - ALLOWED * frequency
            steps = 0.003 / frequency * 1.02 ** np.arange(500)
            first = next((k for k, dt in enumerate(steps) if excess(dt) > 0), None)
            assert first is not None or row["shortest_theory"] is None, text
            if first:
                dt = brentq(excess, steps[first - 1], steps[first])
                assert abs(np.log(row["shortest_theory"] / dt)) < 0.04, f"{text}: {dt}"
        elif growth > 0 and row["method"] == "beuler":
            dt = max(2 * z.real / abs(z)**2 for z in values[:, :-1].ravel() if z.real > 0)
            assert row["damps_theory"] and abs(np.log(row["damps_theory"] / dt)) < 0.03, f"{text}: {dt}"
            hidden += 1
        else:
            assert row["damps_theory"] is None, text
    return hidden


def test_steps_of_theory(scenes):
    assert sum(check(index, p) for index, p in scenes(draw, 342, 8)) >= 3

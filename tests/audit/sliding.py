"""Steady sliding and the operator linearised about it as a dense numpy matrix, built from docs/model alone, and random
scenes: the independent reference of the audits of stability. Derivatives are taken by complex steps."""
import numpy as np


def d2(n, h, order, left, right, form):
    """The second-difference matrix with its closures; 'periodic', 'free' or 'velocity' ends."""
    w = {2: [-2, 1], 4: [-5 / 2, 4 / 3, -1 / 12], 6: [-49 / 18, 3 / 2, -3 / 20, 1 / 90],
         8: [-205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]}[order]
    scale = 1 if form == "chain" else 1 / h**2
    D = np.zeros((n, n))

    def halo(j):  # value beyond an end as a combination of nodes
        if left == "periodic":
            return [(j % n, 1)]
        if 0 <= j < n:
            return [(j, 1)]
        far, kind = (-j, left) if j < 0 else (j - n + 1, right)

        def inside(k):
            return k if j < 0 else n - 1 - k
        if form == "chain":
            return [(inside(far - 1), 1)]
        if kind == "free":
            return [(inside(far), 1)]
        nodes = np.arange(order)
        return [(inside(k), np.prod([(-far - m) / (k - m) for m in nodes if m != k])) for k in nodes]
    for i in range(n):
        for j in range(-(order // 2), order // 2 + 1):
            for at, part in halo(i + j):
                D[i, at] += scale * w[abs(j)] * part
    return D


def law(scene):
    """F(psi, state), g(psi, state), steady state(psi) of one amplitude."""
    p = scene
    name, state = p["friction_law"], p["state_law"]

    def phi(u):
        if name == "cubic":
            return u**3 / 3 - u
        sign = np.sign(u.real)
        return sign / (1 + sign * u) if name == "carlson-langer" else sign * 0.5 + 0 * u

    def size(u):
        return np.sign(u.real) * u
    if name == "rate-and-state":
        a, b, D = p["friction_a"], p["friction_b"], p["friction_D"]

        def F(u, x):
            return a * np.arcsinh(u / 2 * np.exp((0.6 + b * np.log(x / D)) / a))

        def g(u, x):
            y = size(u) * x / D
            return 1 - y if state == "ageing" else -y * np.log(y)
        return F, g, lambda u: D / abs(u)
    if state == "healing":
        t_h, t_inf, D = p["state_t_h"], p["state_tau_inf"], p["state_D"]
        return (lambda u, x: x * phi(u), lambda u, x: (t_inf - x) / t_h - size(u) / D * (x - 1),
                lambda u: (t_inf / t_h + abs(u) / D) / (1 / t_h + abs(u) / D))
    if state == "contact-age":
        b, D, theta0 = p["state_b"], p["state_D"], p["state_theta0"]
        return (lambda u, x: (1 + b * np.log(1 + x / theta0)) * phi(u), lambda u, x: 1 - size(u) * x / D,
                lambda u: D / abs(u))
    return lambda u, x: phi(u), None, None


class Line:
    """Steady sliding of a scene (options by name) and its Jacobian; a: amplitudes of friction, one a node."""

    def __init__(self, p, a=None):
        n, form = p["grid_n"], p["model_form"]
        left, right = p.get("bc_left", "periodic"), p.get("bc_right", "periodic")
        ring = left == "periodic"
        if form == "chain":
            f0 = p.get("model_f0", 1)
            A, B, K0, K1 = f0 / p["model_m"], p["model_zeta"] / f0, p["model_k0"] / f0, p["model_k1"] / f0
            sd, order, self.h = 0, 2, 1
        else:
            A, B, order = p["model_gamma"], 0, p["grid_order"]
            K0, K1 = 1 / A, p["model_c"]**2 / A
            sd = p["model_delta"] * (1 if p.get("model_delta_sign", "derived") == "derived" else -1)
            self.h = p["grid_length"] / (n if ring else n - 1)
        self.A, self.K0, self.K1, self.sd, self.B = A, K0, K1, sd, B
        D, v = d2(n, self.h, order, left, right, form), p["model_v"]
        N = p.get("model_nu", 0) / (f0 if form == "chain" else A)
        held = ([0] if left == "velocity" else []) + ([n - 1] if right == "velocity" else [])
        psi = np.full(n, float(v))
        for i, end in ((0, "left"), (n - 1, "right")):
            if i in held:
                psi[i] = p.get(f"bc_{end}_value", v)
        free = np.array([i for i in range(n) if i not in held])
        rest = psi - v
        rest[free] = 0
        if np.any(rest):
            psi[free] += np.linalg.solve((K0 * np.eye(n) - K1 * D)[np.ix_(free, free)], K1 * (D @ rest)[free])
        self.N, self.D = N, D
        F, g, steady = law(p)
        a = np.ones(n) if a is None else a
        x, e = (steady(psi) if steady else np.zeros(n)), 1e-30
        F_psi, F_x = (a * F(psi + 1j * e, x + 0j)).imag / e, (a * F(psi + 0j, x + 1j * e)).imag / e
        m, I = len(free), np.eye(len(free))
        F_psi, F_x = np.diag(F_psi[free]), np.diag(F_x[free])
        E = -K0 * I + K1 * D[np.ix_(free, free)]
        V = N * D[np.ix_(free, free)]
        rows = [[-A * (B * I + F_psi - V), A * I], [E + sd * (F_psi - V), -sd * I]]
        self.psi, self.free, self.state, self.beta = psi, free, g is not None, B + sd / A + np.diag(F_psi)
        self.weight = np.ones(m)
        if form == "continuum":
            self.weight[0] = 0.5 if left == "free" else 1
            self.weight[-1] = 0.5 if right == "free" else 1
        if g is not None:
            g_psi, g_x = g(psi + 1j * e, x + 0j).imag / e, g(psi + 0j, x + 1j * e).imag / e
            self.steady_state, self.g_psi, self.r = x[free], g_psi[free], -g_x[free]
            rows[0].append(-A * F_x)
            rows[1].append(sd * F_x)
            rows.append([np.diag(self.g_psi), 0 * I, np.diag(-self.r)])
        self.E, self.V, self.J = E, V, np.block(rows)

    def eigenvalues(self):
        """Rightmost first."""
        values = np.linalg.eigvals(self.J)
        return values[np.argsort(-values.real)]


def friction_of(random):
    """Options of a random law and state law."""
    choices = [("cubic", "none"), ("cubic", "contact-age"), ("carlson-langer", "none"), ("coulomb", "contact-age"),
               ("carlson-langer", "healing"), ("rate-and-state", "ageing"), ("rate-and-state", "slip")]
    name, state = choices[random.integers(len(choices))]
    p = {"friction_law": name, "state_law": state}
    if name == "rate-and-state":
        D = random.uniform(0.3, 2)
        p |= {"friction_a": random.uniform(0.02, 0.2), "friction_b": random.uniform(0.02, 0.3), "friction_D": D}
    elif state == "healing":
        p |= {"state_t_h": random.uniform(0.5, 3), "state_tau_inf": random.uniform(1.1, 3),
              "state_D": random.uniform(0.3, 3)}
    elif state == "contact-age":
        p |= {"state_b": random.uniform(0.05, 1), "state_D": random.uniform(0.3, 3),
              "state_theta0": random.uniform(0.3, 3)}
    return p


def scene(random, uniform=False, form=None, least=30, most=110):
    """Options of a random scene by name."""
    v = random.uniform(0.2, 1.5)
    form = form or ("continuum", "chain")[random.integers(2)]
    p = {"model_form": form, "model_v": v, "grid_n": int(random.integers(least, most))}
    ends = random.integers(5)
    kinds = ("free", "velocity")
    if ends:
        p["bc_left"], p["bc_right"] = kinds[(ends - 1) % 2], kinds[(ends - 1) // 2]
        for end in ("left", "right"):
            if p["bc_" + end] == "velocity":
                p[f"bc_{end}_value"] = v if uniform or random.random() < 0.3 else random.uniform(0.15, 1.6)
    p |= friction_of(random)
    if form == "chain":
        p |= {"model_m": random.uniform(0.5, 2), "model_k0": random.uniform(0.05, 1), "model_k1": random.uniform(0.05, 2),
              "model_f0": random.uniform(0.5, 2), "model_zeta": random.choice([0, random.uniform(0, 1)])}
    else:
        p |= {"model_gamma": random.uniform(0.4, 4), "model_c": random.uniform(0.5, 4),
              "model_delta": random.choice([0, random.uniform(0, 0.5)]), "grid_length": random.uniform(5, 60),
              "grid_order": int(random.choice([2, 4, 6, 8] if ends in (0, 1) else [2, 4, 6]))}
    if not uniform and random.random() < 0.7:
        p |= {"friction_spread": random.uniform(0.02, 0.5), "friction_seed": int(random.integers(1000))}
        if form == "continuum":
            p["friction_spread_length"] = random.uniform(0.3, 3)
    return p


def words(p):
    """The options of a scene; one that is an array has a value for each block of a chain: its profile."""
    text = []
    for name, value in p.items():
        if isinstance(value, np.ndarray):
            name, value = name + "_profile", ",".join(f"{i}:{float(at)!r}" for i, at in enumerate(value))
        text += ["-" + name, str(value)]
    return text


def with_profiles(random, p):
    """A scene of a chain without held ends in which some of friction's parameters, or its amplitude, differ from block to
    block."""
    numbers = [name for name in p if name.startswith(("friction_", "state_")) and isinstance(p[name], float)]
    chosen = [name for name in numbers if random.random() < 0.6]
    p = p | {name: p[name] * random.uniform(0.7, 1.4, p["grid_n"]) for name in chosen}
    if not chosen or random.random() < 0.5:
        p["friction_amplitude"] = random.uniform(0.6, 1.5, p["grid_n"])
    return p


def amplitudes(p, steady_psi, steady_eta):
    """The amplitudes of friction that the program drew, out of its steady state: eta = B psi - N D2 psi + a F."""
    F, _, steady = law(p)
    line, x = Line(p), steady(steady_psi) if steady else 0 * steady_psi
    return (steady_eta - line.B * steady_psi + line.N * line.D @ steady_psi) / F(steady_psi + 0j, x + 0j).real

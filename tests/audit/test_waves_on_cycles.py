"""The verdict on waves and their largest growth rate against SciPy: the motion and deviations of very many wavenumbers carried
round together. Uniform motion of continua and chains, laws with a state and without, few wavenumbers asked for."""
import h5py
import numpy as np
from scipy.integrate import solve_ivp

from calls import run

BESIDE_A_STABLE_LIST = (
    "-model_gamma 9.221509752006487 -model_delta 0 -grid_n 18 -grid_length 3.987784639363135 -model_c 2.7482832225020446 "
    "-model_v -0.445817403449582 -friction_law rate-and-state -friction_a 0.17554001525193386 -friction_b 0.32830284679770366 "
    "-friction_D 0.8124353402150759 -friction_psi0 0.16990940156714296")


def draw(rng):
    def uniform(low, high):
        return float(rng.uniform(low, high))
    form = str(rng.choice(["continuum", "chain"]))
    p = {"model_form": form, "cycle_wavenumbers": int(rng.integers(2, 60))}
    if form == "continuum":
        p |= {"model_gamma": float(np.exp(uniform(0, 2.2))), "model_delta": float(rng.choice([0, uniform(0, 0.3)])),
              "model_delta_sign": str(rng.choice(["derived", "printed"])), "model_c": uniform(0.5, 3)}
    else:
        p |= {"model_m": uniform(0.5, 2), "model_k0": uniform(0.1, 0.6), "model_k1": float(np.exp(uniform(-3, 2))),
              "model_f0": uniform(0.7, 1.5), "model_zeta": float(rng.choice([0, uniform(0, 0.2)]))}
    if rng.random() < 0.3:
        p["model_nu"] = float(np.exp(uniform(-5, -1)))
    p["friction_law"] = str(rng.choice(["cubic", "rate-and-state"]))
    p["model_v"] = uniform(0.1, 0.97) * float(rng.choice([-1, 1]))
    if p["friction_law"] == "rate-and-state":
        p |= {"friction_a": uniform(0.12, 0.2), "friction_D": uniform(0.5, 1), "friction_psi0": uniform(0.2, 1.5), "friction_mu0": 0.6}
        p["friction_b"] = p["friction_a"] * uniform(1.5, 2.2)
    return p


class Node:
    """psi, eta and s = ln theta of one node; E: what its neighbours' -D2 psi is of its own, kappa^2."""

    def __init__(self, p):
        if p["model_form"] == "chain":
            f0 = p["model_f0"]
            self.A, self.B, self.K0, self.K1, self.sd = (f0 / p["model_m"], p["model_zeta"] / f0, p["model_k0"] / f0,
                                                         p["model_k1"] / f0, 0)
            self.N = p.get("model_nu", 0) / f0
        else:
            g = p["model_gamma"]
            self.A, self.B, self.K0, self.K1 = g, 0, 1 / g, p["model_c"]**2 / g
            self.sd = p["model_delta"] * (1 if p["model_delta_sign"] == "derived" else -1)
            self.N = p.get("model_nu", 0) / g
        self.p, self.v, self.state = p, p["model_v"], p["friction_law"] == "rate-and-state"

    def law(self, u, s):
        """F, F_psi, F_s, g, g_psi, g_s."""
        if not self.state:
            return u**3 / 3 - u, u * u - 1, 0, 0, 0, 0
        p, a = self.p, self.p["friction_a"]
        slope = np.exp((p["friction_mu0"] + p["friction_b"] * (np.log(p["friction_psi0"] / p["friction_D"]) + s)) / a) / (2 * p["friction_psi0"])
        q = u * slope
        root = np.sqrt(1 + q * q)
        D = p["friction_D"]
        return a * np.arcsinh(q), a * slope / root, p["friction_b"] * q / root, np.exp(-s) - abs(u) / D, -np.sign(u) / D, -np.exp(-s)

    def carried(self, start, period, kappa2):
        """The end of the motion, and the matrix of each wave."""
        n, count = len(start), len(kappa2)

        def together(t, z):
            u, e, s = z[0], z[1], z[2] if n == 3 else 0
            F, F_u, F_s, g, g_u, g_s = self.law(u, s)
            Y = z[n:].reshape(n, count * n)
            k = np.repeat(kappa2, n)
            force = -F_u * Y[0] + Y[1] - self.N * k * Y[0] - (F_s * Y[2] if n == 3 else 0)
            out = [self.A * (e - self.B * u - F), self.K0 * (self.v - u) - self.sd * (e - F)]
            rows = [self.A * (force - self.B * Y[0]), -(self.K0 + self.K1 * k) * Y[0] - self.sd * force]
            if n == 3:
                out.append(g)
                rows.append(g_u * Y[0] + g_s * Y[2])
            return np.concatenate([out, *rows])
        z = np.concatenate([start, np.tile(np.eye(n), (1, count)).ravel()])
        end = solve_ivp(together, (0, period), z, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
        return end[:n], end[n:].reshape(n, count, n).transpose(1, 0, 2)


def compare(p, text):
    """False where there is no cycle."""
    words = " ".join(f"-{name} {value}" for name, value in p.items())
    found, _ = run(words + " -cycle_spectrum -out_file c.h5", command="cycle", code=None)
    if found["status"] != "done":
        return False
    node = Node(p)
    with h5py.File("c.h5") as file:
        start = [file[name][0, 0] for name in ("psi", "eta")] + ([np.log(file["theta"][0, 0])] if node.state else [])
    T, speed = found["period"], np.sqrt(node.A * node.K1)
    last = np.pi if p["model_form"] == "chain" else 100 / (speed * T)
    k = np.unique(np.concatenate([np.linspace(0, last, 500)[1:], np.geomspace(last / 5e3, last, 120), [found["wavenumber"]]]))
    kappa2 = 2 - 2 * np.cos(k) if p["model_form"] == "chain" else k * k
    end, matrices = node.carried(np.array(start), T, kappa2)
    assert np.max(abs(end - start)) < 1e-5, f"{text}: the motion misses by {np.max(abs(end - start))}"
    growth = np.log(np.max(abs(np.linalg.eigvals(matrices)), axis=1)) / T
    first, error = last / p["cycle_wavenumbers"], 1e-6 + 2 * found["multiplier_error"] / T
    assert found["growth_rate"] > np.max(growth[k >= first]) - error, f"{text}: {found['growth_rate']}, but {np.max(growth[k >= first])}"
    if found["wavenumber"] > 0:
        own = growth[np.argmin(abs(k - found["wavenumber"]))]
        assert abs(own - found["growth_rate"]) < error, f"{text}: {own} at {found['wavenumber']}, not {found['growth_rate']}"
    if np.max(growth) > error:
        assert found["stable"] is False, f"{text}: stable {found['stable']}, but {np.max(growth)} at {k[np.argmax(growth)]}"
    if found["stable"] is False:  # without viscosity the mean damping of ever shorter waves may be what grows
        assert found["growth_rate"] > 0 or found["diffusion"] < 0 or "model_nu" not in p, text
    elif found["stable"]:
        assert found["growth_rate"] < 0 and found["diffusion"] > 0, f"{text}: stable beside {found['growth_rate']}"
    return True


def test_waves_on_random_cycles(scenes):
    drawn = compared = 0
    for index, p in scenes(draw, 342, short=8):
        drawn += 1
        compared += compare(p, f"scene {index}: {p}")
    assert compared > drawn / 4, f"{compared} of {drawn}"


def test_few_wavenumbers_are_refined():
    """One verdict and one rate, however few are asked for."""
    for count in (2, 6, 200):
        found, _ = run(f"{BESIDE_A_STABLE_LIST} -cycle_spectrum -cycle_wavenumbers {count}", command="cycle")
        assert found["stable"] is False
        assert abs(found["growth_rate"] - 0.0851366) < 1e-6 and abs(found["wavenumber"] - 0.270712) < 1e-5

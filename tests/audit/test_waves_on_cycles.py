"""The verdict on waves and their largest growth rate against SciPy: the motion and deviations of very many wavenumbers carried
round together. Uniform motion of continua and chains, laws with a state and without, few wavenumbers asked for."""
import numpy as np

from calls import data, run
from reference import System, read, words

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


def compare(p, text):
    """False where there is no cycle."""
    found, _ = run([*words(p), "-cycle_spectrum", "-out_file", "c.h5"], command="cycle", code=None)
    if found["status"] != "done":
        return False
    node, start = System(p | {"grid_n": 1}), read(data("c.h5"), 0)
    T, speed = found["period"], np.sqrt(node.A * node.K1)
    last = np.pi if p["model_form"] == "chain" else 100 / (speed * T)
    k = np.unique(np.concatenate([np.linspace(0, last, 500)[1:], np.geomspace(last / 5e3, last, 120), [found["wavenumber"]]]))
    kappa2 = 2 - 2 * np.cos(k) if p["model_form"] == "chain" else k * k
    end, matrices = node.carried(start, T, -kappa2[:, None, None], rtol=1e-9, atol=1e-11)
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
    for index, p in scenes(draw, 342, short=3):
        drawn += 1
        compared += compare(p, f"scene {index}: {p}")
    assert compared > drawn / 4, f"{compared} of {drawn}"


def test_few_wavenumbers_are_refined():
    """One verdict and one rate, however few are asked for."""
    for count in (2, 6, 200):
        found, _ = run(f"{BESIDE_A_STABLE_LIST} -cycle_spectrum -cycle_wavenumbers {count}", command="cycle")
        assert found["stable"] is False
        assert abs(found["growth_rate"] - 0.0851366) < 1e-6 and abs(found["wavenumber"] - 0.270712) < 1e-5

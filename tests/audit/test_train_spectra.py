"""Spectra of trains of every law and state, signs of speed and of delta, with viscosity and without: against Hill's matrix
at two resolutions. Growth rate, number of modes that grow, what is listed and the verdict are compared."""
import numpy as np

import hill
from calls import run

ROUND = ("-model_gamma 7.5 -model_delta 0 -model_v 0.8 -friction_law rate-and-state -friction_a 0.15 -friction_b 0.25 "
         "-friction_D 0.6 -wave_speed 3")
TO_THE_LEFT = ("-friction_law rate-and-state -model_gamma 7.545502868153148 -model_delta 0.02 -model_c 0.7676044876682471 "
               "-model_v 0.8142169876932426 -friction_a 0.1536182421017615 -friction_b 0.24716150841674042 "
               "-friction_D 0.5840092342548983 -friction_psi0 1.2379896636104442 -wave_speed -4.968464795535325")
ALONE = ("-model_gamma 1.2300152516988043 -model_delta 0.019216238133481556 -model_c 1.4466087981421167 "
         "-model_v 0.8214441065291069 -friction_law coulomb -friction_fs 1.2642453487795013 -friction_fd 0.4104270232957255 "
         "-friction_slip_velocity 1.2824223166067954 -friction_stick regularised -friction_eps 0.4897075562345649 "
         "-wave_speed 2.0736576673169766 -wave_pulses 1")


def draw(rng):
    """Laws of every kind about a train that is not too steep for a dense matrix; half of them of the rate-and-state kind,
    with the many growing modes that strong weakening has."""
    def uniform(low, high):
        return float(rng.uniform(low, high))
    law = str(rng.choice(["cubic", "carlson-langer", "coulomb", "rate-and-state", "rate-and-state", "rate-and-state"]))
    p = {"model_gamma": float(np.exp(uniform(0, 2))), "model_c": uniform(0.5, 1.8), "model_v": uniform(0.3, 1),
         "model_delta": float(rng.choice([0, uniform(0, 0.15)])), "model_delta_sign": str(rng.choice(["derived", "printed"])),
         "friction_law": law, "state_law": "none"}
    if law == "rate-and-state":
        a = uniform(0.1, 0.18)
        p |= {"model_gamma": uniform(3, 9), "model_v": uniform(0.5, 1), "friction_a": a, "friction_b": a * uniform(1.4, 1.9),
              "friction_D": uniform(0.4, 0.8), "friction_mu0": 0.6, "friction_psi0": float(rng.choice([1, uniform(0.5, 1.5)])),
              "state_law": str(rng.choice(["ageing", "ageing", "slip", "ageing-cutoff"]))}
        if p["state_law"] == "ageing-cutoff":
            p["state_psi_h"] = uniform(0.001, 0.05)
    else:
        p["state_law"] = str(rng.choice(["none", "contact-age"] + ["healing"] * (law != "cubic")))
    if law in ("carlson-langer", "coulomb"):
        p |= {"friction_stick": "regularised", "friction_eps": uniform(0.2, 0.5)}
        p |= ({"friction_sigma": float(rng.choice([0, 0.2])), "friction_alpha": uniform(0.3, 1)} if law == "carlson-langer" else
              {"friction_fs": uniform(1, 1.5), "friction_fd": uniform(0.3, 0.9), "friction_slip_velocity": uniform(0.4, 1.5)})
    if p["state_law"] == "healing":
        p |= {"state_D": uniform(0.2, 1), "state_t_h": uniform(0.3, 3), "state_tau_inf": uniform(1.2, 2.5)}
    if p["state_law"] == "contact-age":
        p |= {"state_D": uniform(0.2, 1), "state_b": uniform(0.05, 0.4), "state_theta0": uniform(0.3, 2)}
    p["model_v"] *= float(rng.choice([-1, 1]))
    p["wave_speed"] = p["model_c"] * uniform(1.2, 6) * float(rng.choice([-1, 1]))
    p["wave_pulses"], p["spectrum_count"] = int(rng.integers(1, 4)), int(rng.choice([4, 12, 30]))
    return p


def reference(p, summary, points):
    """Growth rates of the modes that two matrices share, translation left out; None where they do not settle."""
    phase, samples = hill.one_pulse("train.h5", summary)
    lists = []
    for n in points:
        train = hill.Train(p, p["wave_speed"], phase, samples, summary["period"], n)
        if not train.residual_left < 1e-6 or abs(train.period / summary["period"] - 1) > 1e-5:
            return None
        lists.append([train.eigenvalues(2 * np.pi * m / p["wave_pulses"]) for m in range(p["wave_pulses"])])
    shared = np.concatenate([hill.agreed(fine[fine.real > -0.5], coarse, 3e-4) for coarse, fine in zip(*lists)])
    if not len(shared) or np.min(abs(shared)) > 1e-4:  # kinks of |psi| are not smooth enough for so few points
        return None
    return np.delete(shared, np.argmin(abs(shared)))


def distance_of(mode, rest):
    """From the nearest that two matrices share; of one that decays nothing is asked."""
    return np.min(abs(rest - (mode["re"] + 1j * mode["im"]))) if mode["re"] > -0.02 else 0


def lacks(rest, modes):
    return (sum(m["re"] > 1e-3 for m in modes) > sum(rest.real > 1e-3)
            or any(distance_of(m, rest) > 1e-3 for m in modes if not m["translation"]))


def check(p, summary, rest, text):
    rates, found = rest.real, [m for m in summary["eigenvalues"] if not m["translation"]]
    grow, margin = rates[rates > 1e-3], 5e-4
    assert summary["complete"] == (not any("not complete" in w for w in summary["warnings"])), text
    if len(grow):
        assert summary["stable"] is False, f"{text}: {summary['stable']}, but {max(grow)}"
    elif summary["stable"] is False:
        assert summary["growth_rate"] < 1e-3, f"{text}: {summary['growth_rate']}, but {max(rates)}"
    if not summary["complete"]:
        return False
    if summary["growth_rate"] is not None:
        assert abs(summary["growth_rate"] - max(rates)) < margin, f"{text}: {summary['growth_rate']}, but {max(rates)}"
        assert summary["growth_rate"] == max(m["re"] for m in found), text
    listed = sum(m["re"] > 1e-3 for m in found)
    assert listed == min(len(grow), p["spectrum_count"]), f"{text}: {listed} growing modes listed, there are {len(grow)}"
    for m in found:
        distance = distance_of(m, rest)
        assert distance < 1e-3, f"{text}: {m} is not in the matrix by {distance}"
    assert len({(round(m["re"], 8), round(m["im"], 8), m["bloch"]) for m in found}) == len(found), f"{text}: listed twice"
    return True


def command(p):
    return " ".join(f"-{name} {value}" for name, value in p.items()) + " -wave_spectrum"


def test_random_spectra(scenes):
    drawn = compared = 0
    for index, p in scenes(draw, 341, short=1):
        summary, _ = run(command(p) + " -out_file train.h5", command="wave", code=None)
        drawn += 1
        if summary["status"] != "done":  # nothing oscillates
            continue
        rest = reference(p, summary, (111, 151))
        if rest is not None and lacks(rest, summary["eigenvalues"]):
            rest = reference(p, summary, (181, 241))  # the fastest of many that grow want more points
        compared += rest is not None and check(p, summary, rest, f"scene {index}: {command(p)}")
    assert compared > drawn / 6, f"{compared} of {drawn} could be compared"


def test_more_growing_modes_than_are_wanted():
    """Of 22 that grow the rightmost 12 are listed, each once."""
    for options, growth, frequency in ((ROUND, 0.0929125, 2.3473717), (TO_THE_LEFT, 0.0926601, 4.6657347)):
        summary, _ = run(f"{options} -wave_spectrum", command="wave")
        assert summary["complete"] and summary["stable"] is False and summary["endless"]["stable"] is False
        assert abs(summary["growth_rate"] - growth) < 1e-6 and len(summary["eigenvalues"]) == 12
        for k, mode in enumerate(summary["eigenvalues"]):  # in pairs of conjugates
            other = summary["eigenvalues"][k ^ 1]
            assert abs(mode["re"] - other["re"]) < 1e-9 and abs(mode["im"] + other["im"]) < 1e-9 and mode["re"] > 0.06
        assert abs(abs(summary["eigenvalues"][0]["im"]) - frequency) < 1e-5


def test_growth_rate_is_that_of_a_mode():
    """Beside the translation the first mode lies far left: it is found, no line is given for it."""
    summary, _ = run(f"{ALONE} -wave_spectrum -spectrum_count 14", command="wave")
    assert summary["stable"] and abs(summary["growth_rate"] + 0.0926233) < 1e-6
    assert abs(abs(summary["eigenvalues"][1]["im"]) - 0.8824346) < 1e-6

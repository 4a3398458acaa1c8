"""-accuracy in spread media with probes: random scenes against the same medium by characteristics (media.py)."""
import numpy as np
import pytest

from calls import run

from .media import Medium

PARTS = 64  # probes stand at multiples of the length over this


def draw(r):
    kind = r.choice(["ring", "ring", "free", "held"])
    spread, cells = round(r.uniform(0.05, 0.5), 3), int(r.choice([4, 8, 16]))
    length = round(cells * r.uniform(0.4, 1.5), 3)
    c, gamma = round(10**r.uniform(-0.3, 0.3), 3), round(10**r.uniform(-0.3, 0.6), 3)
    delta, v = float(r.choice([0, 0.1, 0.2])), round(r.uniform(-1.2, 1.2), 3)
    seed = int(r.integers(1, 1000))
    t_end = length / c / PARTS * max(1, round(r.uniform(0.3, 2.5) * c * PARTS / length))
    mean, height, eta = round(r.uniform(-0.5, 1.2), 3), round(r.uniform(0, 0.5), 3), round(r.uniform(-0.3, 0.3), 3)
    probes = sorted({0} | set(r.integers(0, PARTS, 12).tolist()) | (set() if kind == "ring" else {PARTS}))
    accuracy = 10**r.uniform(-6, -2)
    words = ["-model_gamma", gamma, "-model_delta", delta, "-model_c", c, "-model_v", v, "-grid_length", length,
             "-friction_spread", spread, "-friction_seed", seed, "-friction_spread_length", repr(length / cells),
             "-init_psi", mean, "-ts_max_time", repr(t_end), "-accuracy", accuracy,
             "-out_probes", ",".join(repr(length * i / PARTS) for i in probes)]
    ends, start = (None, None), lambda x: mean + height * np.sin(2 * np.pi * x / length)
    force = lambda x, psi, a: eta
    if kind == "ring":
        words += ["-init_type", "sine", "-init_amplitude", height, "-init_eta", eta]
    elif kind == "free":
        words += ["-bc_left", "free", "-bc_right", "free", "-init_eta", eta]
        ends, start = ("free", "free"), lambda x: mean + 0 * x
    else:  # data that fit the held end in psi, psi_t and psi_tt: (psi_e - v) w^2 = 2 c^2 (psi_i - psi_e)
        width = round(length / 6, 3)
        held = v + (mean - v) / (1 + width**2 / (2 * c**2))
        words += ["-bc_left", "velocity", "-bc_left_value", repr(held), "-bc_right", "free", "-init_type", "layer",
                  "-init_width", width]
        ends, start = (held, "free"), lambda x: mean + (held - mean) * np.exp(-(x / width)**2)
        force = lambda x, psi, a: a * psi * (psi * psi / 3 - 1)
    medium = Medium(gamma, delta, c, v, length, spread, seed, length / cells, *ends)
    return words, medium, start, force, t_end, probes, accuracy


def examined(words, medium, start, force, t_end, probes, accuracy, ranks=1):
    """The largest error at the probes (None where the request is refused) and the run's summary."""
    made, _ = run(words, ranks=ranks, code=None)
    if made["status"] != "done":
        return None, made
    for finest in (2048, 8192):
        (psi, eta), doubt = medium.solution(start, force, t_end, PARTS, finest)
        if doubt / 8 < accuracy / 20:  # corners carried along leave errors like h^3
            break
    else:
        raise AssertionError(f"the reference itself errs by {doubt / 8:.1e} of {accuracy:.1e}: {words}")
    step = (len(psi) - (0 if medium.ring else 1)) // PARTS
    exact = np.array([[psi[i * step], eta[i * step]] for i in probes])
    return np.abs(np.array([[p["psi"], p["eta"]] for p in made["probes"]]) - exact).max(), made


def audited(drawn, ranks=lambda index: 1):
    wrong, ratios, refused, excess = [], [], [], []
    for index, scene in drawn:
        words, *_, accuracy = scene
        error, made = examined(*scene, ranks=ranks(index))
        text = f"{index}: wanted {accuracy:.1e}: " + " ".join(map(str, words))
        if error is None:
            refused.append(text + "\n    " + made["reason"])
            continue
        ratios.append(error / accuracy)
        excess.append(made["error_estimate"] / error)
        if error > accuracy or not error / 3 <= made["error_estimate"] <= accuracy:
            wrong.append(f"error {error:.1e} estimate {made['error_estimate']:.1e} {text}")
    print(f"error/wanted: median {np.median(ratios):.3f}, largest {max(ratios):.3f}; estimate/error: least "
          f"{min(excess):.2f}; {len(refused)} refused")
    assert len(refused) <= len(ratios) / 20, "\n".join(refused)
    assert not wrong, "\n".join(wrong)


def test_error_and_estimate_at_probes(scenes):
    audited(scenes(draw, 165, short=10))


def draw_with_rosenbrock(r):
    words, *rest, accuracy = draw(r)
    if r.random() < 0.5:
        accuracy = max(accuracy, 1e-4)
        words += ["-ts_type", "rosw", "-ts_rosw_type", "ra34pw2"]
    words[words.index("-accuracy") + 1] = accuracy
    return words, *rest, accuracy


def test_errors_in_time_that_fall_slower_than_the_tolerance():
    """Rosenbrock steps whose tolerance is far below that at which they were seen to err: predicted in proportion, the run
    missed the request by 1.6 times, with an estimate of a third of its error."""
    audited([(65, draw_with_rosenbrock(np.random.default_rng([6, 1610, 65])))])


@pytest.mark.ranks
def test_on_several_ranks(scenes):
    """Every fifth scene on two and three ranks, by explicit steps and by implicit ones, which the ranks solve together."""
    audited(((i, scene) for i, scene in scenes(draw_with_rosenbrock, 1610) if i % 5 == 0), lambda i: 2 + i // 5 % 2)

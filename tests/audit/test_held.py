"""Held ends: the state that they start with, and the force on a held block, against formulas and dense solves."""
import h5py
import numpy as np

import calls

STATE_LAWS = {"none": ("cubic", ""), "healing": ("coulomb", "tau"), "contact-age": ("cubic", "theta"),
              "ageing": ("rate-and-state", "theta"), "slip": ("rate-and-state", "theta")}


def draw(random):
    both = bool(random.random() < 0.5)
    left = bool(both or random.random() < 0.5)
    ends = {0: float(random.uniform(0.2, 1.5)) * random.choice([-1, 1]) if left else None,
            -1: float(random.uniform(0.2, 1.5)) if both or not left else None}
    return dict(chain=bool(random.random() < 0.7), n=int(random.integers(17, 25)), ends=ends,
                law=list(STATE_LAWS)[random.integers(len(STATE_LAWS))], v=float(random.uniform(0.2, 1)),
                k0=float(random.choice([0, 0.3, 1.1])), k1=float(random.uniform(0.1, 2)),
                f0=float(random.uniform(0.5, 2)), D=float(random.uniform(0.3, 1.5)),
                start=str(random.choice(["-init_psi 0.4 -init_eta steady", "-init_type sine -init_psi 1 -init_eta 0.3"])),
                given=bool(random.random() < 0.2))


def test_start_and_force_of_held_nodes(scenes):
    blocks = 0
    for index, s in scenes(draw, salt=607, short=12):
        law, name = STATE_LAWS[s["law"]]
        medium = f"-model_form chain -model_k0 {s['k0']} -model_k1 {s['k1']} -model_f0 {s['f0']} -model_zeta 0.3" \
            if s["chain"] else "-grid_length 8 -model_gamma 1.3 -model_delta 0.1"
        distance = {"healing": "-state_t_h 2 -state_tau_inf 1.7 -state_D {}", "contact-age": "-state_D {}",
                    "ageing": "-friction_D {}", "slip": "-friction_D {}", "none": ""}[s["law"]].format(s["D"])
        ends = " ".join(f"-bc_{side} velocity -bc_{side}_value {s['ends'][k]}" if s["ends"][k] is not None
                        else f"-bc_{side} free" for side, k in (("left", 0), ("right", -1)))
        given = " -init_state 0.77" if s["given"] and name else ""
        calls.run(f"{medium} -grid_n {s['n']} -model_v {s['v']} -friction_law {law} -state_law {s['law']} {distance} {ends}"
                  f" {s['start']}{given} -ts_type rk -ts_rk_type 4 -ts_dt 0.01 -ts_adapt_type none -ts_max_time 0.6"
                  " -out_frames 4 -out_displacement -out_file h.h5")
        with h5py.File("h.h5") as file:
            found = {key: file[key][:] for key in file if isinstance(file[key], h5py.Dataset)}
        what = f"scene {index} {s}"
        for k, psi in s["ends"].items():
            if psi is None:
                continue
            assert (found["psi"][:, k] == psi).all(), what
            assert np.allclose(found["chi"][:, k], psi * found["t"], rtol=1e-12, atol=1e-12), what
            if name:
                speed = abs(psi)
                steady = (1.7 / 2 + speed / s["D"]) / (1 / 2 + speed / s["D"]) if s["law"] == "healing" else s["D"] / speed
                expected = 0.77 if given else steady
                assert abs(found[name][0, k] - expected) < 1e-12 * max(1, expected), f"{what}: {name} {found[name][0, k]!r}"
                if not given:  # steady at the velocity that it keeps
                    assert np.allclose(found[name][:, k], expected, rtol=1e-9), what
        if not s["chain"]:
            continue
        # f0 eta = k0 (v t - chi) + k1 (neighbours - chi), held blocks too; and chi from eta of the others by a dense solve
        t, chi, eta = found["t"], found["chi"], found["eta"]
        apart = np.diff(chi, axis=1)
        pull = np.zeros_like(chi)
        pull[:, :-1] += s["k1"] * apart
        pull[:, 1:] -= s["k1"] * apart
        force = (s["k0"] * (s["v"] * t[:, None] - chi) + pull) / s["f0"]
        assert np.abs(force - eta).max() < 1e-8 * max(1, np.abs(eta).max()), f"{what}: {np.abs(force - eta).max(axis=0)}"
        blocks += 1
    assert blocks

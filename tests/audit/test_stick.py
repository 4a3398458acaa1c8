"""Friction that sticks, in the continuum and in chains, against an integration of its own (sticking.py)."""
import h5py
import numpy as np

import calls

from .sticking import Medium, factors, options_of


def draw(random):
    chain = bool(random.random() < 0.3)
    s = dict(chain=chain, n=int(random.integers(9, 21)), order=2 if chain else int(random.choice([2, 4, 6, 8])),
             ring=bool(random.random() < 0.5), v=random.uniform(0.02, 0.3), law=str(random.choice(["coulomb", "carlson-langer"])),
             state="healing" if random.random() < 0.3 else "none", seed=int(random.integers(1, 10**6)),
             spread=random.uniform(0.05, 0.3), psi=random.uniform(0, 0.3), amplitude=random.uniform(0.05, 0.6),
             eta=random.uniform(-0.3, 0.6), t_end=random.uniform(2, 5), fs=1., fd=random.uniform(0.4, 1),
             sigma=random.uniform(0, 0.2), alpha=random.uniform(0.2, 1), t_h=random.uniform(1, 5), tau_inf=random.uniform(1.2, 2),
             D=random.uniform(0.3, 2))
    if chain:
        s.update(m=random.uniform(0.5, 2), k0=random.uniform(0.1, 1), k1=random.uniform(0.2, 2), f0=random.uniform(0.5, 1.5),
                 zeta=float(random.choice([0, 0.2])))
    else:
        s.update(gamma=random.uniform(0.5, 2), c=random.uniform(0.5, 1.5), delta=float(random.choice([0, random.uniform(0.05, 0.3)])),
                 sign=str(random.choice(["derived", "printed"])), length=random.uniform(5, 10))
    return s


def test_motion(scenes):
    total = 0
    for index, s in scenes(draw, salt=610, short=12):
        frames = 5
        calls.run(options_of(s) + ["-init_type", "sine", "-init_psi", s["psi"], "-init_amplitude", s["amplitude"], "-init_eta",
                                   s["eta"], "-ts_max_time", s["t_end"], "-ts_rtol", 1e-11, "-ts_atol", 1e-12,
                                   "-out_frames", frames, "-scene_reduce", "off", "-out_file", "s.h5"])
        with h5py.File("s.h5") as file:
            t, fields = file["t"][:], [file[k][:] for k in (("psi", "eta", "tau") if s["state"] == "healing" else ("psi", "eta"))]
        medium = Medium(s, factors(s))
        y = medium.start(*[f[0] for f in fields])
        for k in range(1, frames):
            y, changes = medium.advance(y, t[k - 1], t[k])
            total += changes
            expected = medium.parts(y)
            for name, values, own in zip(("psi", "eta", "tau"), fields, expected):
                error = np.abs(values[k] - own).max()
                assert error < 1e-6, f"scene {index} {s}: {name} off by {error:.2g} at t = {t[k]}"
            assert ((fields[0][k] == 0) == (medium.dir == 0)).all(), f"scene {index} {s}: who rests at t = {t[k]}"
    print(total, "changes")
    assert total > 20

"""-accuracy_of events and chart_of events: when slip events of random chains with exact stick begin and end, against the motion by
DOP853 from change to change (reference.py) and the definition of an event applied to who slides when."""
import numpy as np

from calls import data, run
from reference import Stick, System, read, words


def draw(r):
    n = int(r.integers(2, 9))
    p = {"model_form": "chain", "grid_n": n, "scene_reduce": "off", "model_k0": r.uniform(0.3, 1), "model_k1": r.uniform(0.2, 2),
         "model_zeta": float(r.choice([0, r.uniform(0, 0.3)])), "model_v": r.uniform(0.02, 0.2), "bc_left": "free",
         "friction_law": str(r.choice(["carlson-langer", "coulomb", "stribeck"])), "init_psi": 0., "init_eta": 0.4, "init_noise": 0.4,
         "init_noise_of": "eta", "init_seed": int(r.integers(1000))}
    if r.random() < 0.3:
        p["bc_left"] = "periodic"
    if p["friction_law"] == "carlson-langer":
        p |= {"friction_sigma": r.uniform(0, 0.1), "friction_alpha": r.uniform(0.3, 1.5)}
    p["ts_max_time"] = r.uniform(1, 3) / p["model_k0"] / p["model_v"]
    return p, 10 ** r.uniform(-7, -2)


def events(p, segments, t_end):
    """(begin, end) of those that have ended; nodes that move in or beside an event's region belong to it, regions that meet are one."""
    n, ring, live, done = p["grid_n"], p["bc_left"] == "periodic", [], []
    for begin, end, going in segments:
        for region in [e for e in live if not any(going[i] for i in e[1])]:
            live.remove(region)
            done.append((region[0], begin))
        for i in np.flatnonzero(going):
            beside = {int(i), *((i - 1) % n, (i + 1) % n)} if ring else {int(i), i - 1, i + 1}
            met = [e for e in live if e[1] & beside]
            merged = (min([begin, *(e[0] for e in met)]), {int(i)}.union(*(e[1] for e in met)))
            live = [e for e in live if e not in met] + [merged]
    return np.array(sorted(done)).ravel(), any(going.any() for _, _, going in segments[-1:])


def by_scipy(p, start, rtol):
    motion = Stick(System(p), start, rtol=rtol, atol=rtol / 10)
    motion.advance(p["ts_max_time"])
    return events(p, [(begin, end, going) for begin, end, going, *_ in motion.segments], p["ts_max_time"])[0]


def test_when_events_begin_and_end(scenes):
    wrong, met, unknown = [], 0, 0
    for index, (p, accuracy) in scenes(draw, salt=6902, short=4):
        made, _ = run([*words(p), "-accuracy", accuracy, "-accuracy_of", "events", "-out_events", "true", "-out_file", "e.h5"], code=None)
        text = f"{index}: {accuracy:.1e}: " + " ".join(words(p))
        if made["status"] != "done":
            if "no events" not in made["reason"]:
                print(text, made["reason"])
            continue
        file = data("e.h5")
        times = np.array(sorted(zip(file["events/begin"], file["events/t"]))).ravel()
        rough, fine = (by_scipy(p, read(file, 0), rtol) for rtol in (1e-10, 2e-12))
        if len(rough) != len(fine) or (len(fine) and np.abs(rough - fine).max() > accuracy / 4):
            unknown += 1  # the motion amplifies more than the reference can follow
        elif len(times) != len(fine):
            wrong.append(f"{text}\n    {len(times)} times in place of {len(fine)}")
        elif np.abs(times - fine).max() > max(made["error_estimate"], 1e-11) or made["error_estimate"] > accuracy:
            wrong.append(f"{text}\n    errs by {np.abs(times - fine).max():.2e}, {made['error_estimate']:.2e} is stated")
        else:
            met += 1
    print(f"{met} met, {unknown} unknown, {len(wrong)} wrong")
    assert not wrong, "\n".join(wrong)
    assert met

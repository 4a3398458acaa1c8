"""n-shaped friction: its shape, all uniform motions of a chain without k0 at one force, a front between two of them."""
import math

import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from calls import check, refused, run, scene_file
from reference import Law, System, options

CHAIN = ("-model_form chain -model_k0 0 -model_k1 10 -model_v 0.01 -friction_law n-shaped -friction_D 1"
         " -friction_psi0 0.1 -friction_psi_s 0.1 -state_psi_h 0.005 -bc_left free")
PSI_S, PSI_H = 0.1, 0.005
LAW = Law(options(CHAIN))


def steady(psi):
    return LAW.force(psi, LAW.steady(psi))


def test_three_motions_at_one_force():
    # without k0 the force stays: all velocities that it carries, those on the falling branch unstable
    s, _ = run(CHAIN + " -grid_n 60 -init_eta 0.72", command="spectrum")
    psi = np.logspace(-8, 3, 4000)
    off = steady(psi) - 0.72
    exact = [brentq(lambda p: steady(p) - 0.72, psi[i], psi[i + 1], xtol=1e-16) for i in np.where(np.diff(np.sign(off)))[0]]
    found = s["uniform_states"]
    check(len(exact) == 3 and np.allclose([u["psi"] for u in found], exact, rtol=1e-9), f"{found} instead of {exact}")
    check([u["stable"] for u in found] == [True, False, True], "the one where friction falls is unstable")
    for u in found:
        h = 1e-5 * u["psi"]
        check(abs(u["slope"] - (steady(u["psi"] + h) - steady(u["psi"] - h)) / (2 * h)) < 1e-6 * abs(u["slope"]) + 1e-7, f"{u}")
    # on the falling branch the uniform mode leaves it: lambda (lambda + a) + r b = 0, a = F_psi, b = dF_ss/dpsi
    u = found[1]
    a, _, _, r = LAW.slopes(u["psi"], LAW.steady(u["psi"]))
    rate = max(np.roots([1, a - r, -r * u["slope"]]).real)
    check(abs(u["growth_rate"] - rate) < 1e-6 * rate and u["wavenumber"] == 0, f"{u} instead of {rate}")
    # n-shaped: extremes near psi_h sqrt(a/(b - a)) and psi_s (b - a)/a; other chains have no such list
    values = steady(psi)
    turns = [psi[i] for i in range(1, len(psi) - 1) if (values[i] - values[i - 1]) * (values[i + 1] - values[i]) < 0]
    check(len(turns) == 2 and abs(turns[0] / PSI_H - 1) < 0.2 and abs(turns[1] / PSI_S - 1) < 0.2, f"extremes at {turns}")
    s, _ = run("-model_form chain -grid_n 8", command="spectrum")
    check(s["uniform_states"] is None, "with k0 there is one motion")


def test_a_front_between_two_of_them():
    n, low, high, end = 110, 0.00397, 0.891099, 60
    run(scene_file("front-states") + f" -grid_n {n} -ts_max_time {end} -out_frames 121 -out_file front.h5")
    with h5py.File("front.h5") as f:
        t, psi, eta, theta = (f[name][:] for name in ("t", "psi", "eta", "theta"))

    system = System(CHAIN.replace("free", "velocity") + f" -grid_n {n}")

    def rates(_, y):  # node by node: a banded Jacobian
        return system.rates(0, y.reshape(n, 3).T.ravel()).reshape(3, n).T.ravel()

    start = np.stack([psi[0], eta[0], np.log(theta[0])], axis=1).ravel()
    scipy = solve_ivp(rates, (0, end), start, method="LSODA", lband=4, uband=4, rtol=1e-7, atol=1e-9, t_eval=t).y[0::3].T

    def arrivals(fields):  # of the middle velocity at blocks 40, 60, 80, 100
        middle, found = math.log(math.sqrt(low * high)), []
        for block in (40, 60, 80, 100):
            k = int(np.argmax(fields[:, block] > math.exp(middle)))
            found.append(np.interp(middle, np.log(fields[k - 1:k + 1, block]), t[k - 1:k + 1]))
        return np.array(found)

    ours, theirs = arrivals(psi), arrivals(scipy)
    check(np.abs(ours - theirs).max() < 0.02, f"arrivals {ours}, by scipy {theirs}")
    speed = 20 / np.diff(ours)
    check(np.all(np.diff(speed) > 0) and 1.8 < speed[-1] < 2.2, f"the front runs and settles: {speed}")
    k = int(np.searchsorted(t, ours[-1]))
    check(np.abs(psi[k, 3:30] / high - 1).max() < 0.05 and np.abs(eta[k, 3:30] - 0.72).max() < 0.02, "behind it, the fast motion")


def test_other_state_laws_go_with_it():
    s, _ = run("-friction_law n-shaped -grid_n 16 -ts_max_time 0.1")
    check(s["options"]["state_law"] == "ageing-cutoff", "its own by default")
    s, _ = run("-friction_law n-shaped -state_law slip -friction_D 0.7 -grid_n 16 -ts_max_time 0.1")
    check(s["options"]["state_D"] == "0.7", "one slip distance under two names")
    s, _ = run("-friction_law rate-and-state -state_law ageing-cutoff -grid_n 16 -ts_max_time 0.1 -init_psi 0 -model_v 0")
    check(s["status"] == "done", "ageing that ends has a steady state at rest")
    refused("-friction_law cubic -state_law ageing-cutoff", 2, "ageing-cutoff", "rate-and-state or n-shaped")
    refused("-friction_law rate-and-state -friction_psi_s 1", 2, "psi_s")

"""Fronts that are known: chains with Coulomb friction and without springs to the plate, of which the first block slips. Printed:
the table of docs/events.md."""
import os
import tempfile

import h5py
import numpy as np

from calls import run

# K. Thogersen et al., minimal model of rupture (arXiv 1906.06079): prestress over the threshold, dynamic viscosity, which is
# all that resists motion; blocks, time in which all of them come to rest, and the speed in long chains
THOGERSEN = ((0.5, 0.01, 120, 1000, 1.1516), (0.3, 0.1, 200, 5000, 0.9989), (0.2, 0.5, 120, 8000, 0.6532),
             (0.8, 0.1, 100, 4000, 1.6466))


def start(eta):
    np.savetxt("start.txt", np.c_[np.arange(len(eta)), 0 * eta, eta], fmt="%.17g")
    return f" -grid_n {len(eta)} -init_type text -init_file start.txt"


def front(tau, alpha, n, until):
    """Speed of the front and its error, in units of c = sqrt(k1/m). The last block is held."""
    run("-model_form chain -model_m 1 -model_f0 1 -model_k0 0 -model_k1 1 -friction_law coulomb -friction_fd 0 -friction_back_slip"
        " false -bc_left free -bc_right velocity -bc_right_value 0 -ts_rtol 1e-6 -ts_atol 1e-7 -out_events -out_events_velocity 0.01"
        f" -out_rupture -out_series false -out_frames 2 -out_file front.h5 -model_zeta {alpha} -ts_max_time {until}"
        + start(np.r_[1 + 1e-9, np.full(n - 1, tau)]))
    with h5py.File("front.h5") as file:
        events = file["events"]
        assert events["extent"][0] == n - 1 and np.isnan(events["front_speed_left"][0]), "all slip but the held one"
        return events["front_speed_right"][0], events["front_speed_right_error"][0]


def main():
    print("| prestress | alpha | blocks | speed over c | error of the fit | in long chains |\n|---|---|---|---|---|---|")
    for tau, alpha, n, until, speed in THOGERSEN:
        found, error = front(tau, alpha, n, until)
        print(f"| {tau} | {alpha} | {n} | {found:.4f} | {error:.0e} | {speed} |")


if __name__ == "__main__":
    os.chdir(tempfile.mkdtemp())
    main()

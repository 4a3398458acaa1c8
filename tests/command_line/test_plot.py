"""What the picture of a block says is what the summary says: the period, a closed loop."""
import os
import sys

import h5py
import numpy as np
import pytest

from calls import SOURCE, check, run

sys.path.insert(0, os.path.join(SOURCE, "postprocess"))


@pytest.mark.parametrize("scene", ["-model_k0 1 -model_v 0.5", "-model_k0 1 -model_v -0.4 -model_zeta 0.2",
                                   "-model_k0 1 -model_v 0.1 -friction_law carlson-langer -init_psi 0",
                                   "-model_k0 0.5 -model_v 0.2 -friction_law coulomb -init_psi 0"])
def test_the_period_is_the_summary_s_and_the_loop_is_closed(scene):
    import figures_run
    s, _ = run(f"-model_form chain -grid_n 1 -bc_left free {scene} -ts_max_time 200 -out_probes 0 -out_file b.h5")
    with h5py.File("b.h5") as file:
        times = figures_run.passages(file["series/t"][...], file["series/psi_mean"][...], file.attrs["v"])
        check(abs((times[-1] - times[0]) / (len(times) - 1) / s["period"] - 1) < 1e-4, f"{times} {s['period']}")
        figure = figures_run.draw_block(file, None)
    lines = {line.get_label(): line for axes in figure.axes for line in axes.get_lines()}
    name = next(label for label in lines if label.startswith("last period"))
    check(name == f"last period, {s['period']:.4g}", f"{name} {s['period']}")
    x, y = lines[name].get_data()
    check(np.hypot(x[-1] - x[0], y[-1] - y[0]) < 2e-2 * np.hypot(np.ptp(x), np.ptp(y)), f"from {x[0], y[0]} to {x[-1], y[-1]}")

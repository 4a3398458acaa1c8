"""What the picture of a block says is what the summary says: the period, a closed loop."""
import json
import os
import subprocess
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


def test_a_picture_as_a_journal_wants_it():
    """The size, the style sheet, the names of axes are the user's; so is a matplotlibrc; a title names what acts."""
    run("-model_form chain -grid_n 1 -bc_left free -sweep_parameter1 model_v -sweep_values1 0.2,0.4 -ts_max_time 20 "
        "-out_file s.h5", command="sweep")
    with open("journal.mplstyle", "w", encoding="utf-8") as file:
        file.write("font.size: 7\nfont.family: serif\nlines.linewidth: 2.6\n")
    os.mkdir("config")
    with open("config/matplotlibrc", "w", encoding="utf-8") as file:
        file.write("figure.figsize: 5.0, 4.0\naxes.linewidth: 2\n")
    script = ("import sys, json, matplotlib; sys.path.insert(0, sys.argv[1]); import drawing, style, plot\n"
              "kept = []\n"
              "style.Figure.savefig = lambda figure, *a, **b: kept.append(figure)\n"
              "code = plot.main(sys.argv[2:])\n"
              "axes = kept[0].axes[0]\n"
              "print(json.dumps([list(kept[0].get_size_inches()), axes.get_xlabel(), axes.xaxis.label.get_fontsize(),\n"
              "                  axes.lines[0].get_linewidth(), matplotlib.rcParams['axes.linewidth'], kept[0]._suptitle.get_text()]))")

    def drawn(*more, config="nowhere"):
        done = subprocess.run([sys.executable, "-B", "-c", script, os.path.join(SOURCE, "postprocess"), "s.h5", "-o", "a.pdf", *more],
                              capture_output=True, text=True, env={**os.environ, "MPLCONFIGDIR": os.path.abspath(config)}, check=False)
        check(done.returncode == 0, done.stderr)
        return json.loads(done.stdout.splitlines()[-1])
    size, label, font, width, edge, title = drawn()
    check(size[0] == 7.2 and font == 9 and edge == 0.7 and "velocity" in label, f"as it is: {size} {font} {edge} {label}")
    check("k_1" not in title and "zeta" not in title and "m" in title, f"one block without damping: {title}")
    own = drawn("--size", "3.4x2.6", "--style", "journal.mplstyle", "--label", "model_v=Disc speed (m/s)")
    check(own[:3] == [[3.4, 2.6], "Disc speed (m/s)", 7] and own[3] == 2 * width, f"as asked: {own}")
    configured = drawn(config="config")
    check(configured[0][0] == 5 and configured[4] == 2 and configured[2] == 9, f"a matplotlibrc: {configured}")

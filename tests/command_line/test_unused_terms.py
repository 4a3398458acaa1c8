"""What a scene does not use costs it nothing: viscosity between neighbours, a load, profiles, a mass of 0, states. The bits of
plain scenes are those of the program before there were such terms; null values of terms are none; memory a node is what the
unknowns of plain equations take."""
import hashlib
import subprocess

import numpy as np
import pytest

from calls import SANITIZED, check, data, line, run

FIXED = "-init_type text -init_file start.txt -ts_type rk -ts_rk_type 3bs -ts_adapt_type none -ts_dt 0.015625 -ts_max_time 1.5 " \
        "-scene_reduce off -out_frames 2 "
# Of psi and eta at the end, with friction of + - * / alone and a start of dyadic numbers: the same on every processor.
BITS = {"ring": ("-grid_n 64 -grid_length 64", "258a3f9dc069224e"),
        "orders": ("-grid_n 64 -grid_length 32 -grid_order 8 -model_delta 0.5", "5f22918f5d51ce65"),
        "held": ("-grid_n 65 -grid_length 64 -grid_order 2 -bc_left velocity -bc_left_value -0.5", "078df6d0c54615a1"),
        "chain": ("-model_form chain -grid_n 64 -bc_left free -model_zeta 0.25 -model_k1 2", "89ebb456bb6dbe57"),
        "stick": ("-model_form chain -grid_n 64 -friction_law carlson-langer -friction_alpha 1 -model_k1 0.5 -model_v 0.0625", "8fc3b7dcba95cca3")}


def write_start(n, length):
    """Dyadic numbers, so that no function of the library's has a say."""
    with open("start.txt", "w", encoding="utf-8") as file:
        for i in range(n):
            file.write(f"{i * length} {(i * 37 % 101) / 64 - 0.5!r} {(i * 53 % 97) / 128!r}\n")


@pytest.mark.parametrize("name", BITS)
def test_bits_of_plain_scenes(name):
    options, known = BITS[name]
    n = 65 if name == "held" else 64
    write_start(n, 0.5 if name == "orders" else 1)
    run(FIXED + options + " -out_file plain.h5")
    end = data("plain.h5")
    found = hashlib.sha256(end["psi"][-1].tobytes() + end["eta"][-1].tobytes()).hexdigest()[:16]
    check(found == known, f"{name}: {found} instead of {known}, psi from {end['psi'][-1].min()} to {end['psi'][-1].max()}")


def test_null_values_of_terms_are_none():
    write_start(64, 1)
    options = FIXED + "-model_form chain -grid_n 64 -friction_law coulomb -model_v 0.25 -model_zeta 0.25 "
    counts, fields = [], []
    for term in ("", "-model_nu 0", "-load_v 0:0.25", "-friction_fs_profile 0:1", "-friction_amplitude_profile 0:1", "-model_drag 0"):
        s, _ = run(options + term + " -out_file null.h5")
        end = data("null.h5")
        counts.append((s["steps"], s["rhs_evaluations"], s["unknowns"]))
        fields.append(np.concatenate([end["psi"][-1], end["eta"][-1]]))
    check(all(np.array_equal(f, fields[0]) for f in fields[:2] + fields[3:]), "bits")
    # v(t) is asked for at every stage, by products of times
    check(np.max(np.abs(fields[2] - fields[0])) < 1e-12, "a constant load")
    check(all(c == counts[0] for c in counts), f"{counts}")


PEAK = ("import resource, subprocess, sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True); "
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)")


@pytest.mark.skipif(SANITIZED, reason="the sanitizers keep what is freed")
def test_memory_a_node():
    # 77 to 82 bytes a node before there were such terms and with them; 16 more would be another vector
    peaks = [1024 * int(subprocess.run(["python3", "-c", PEAK, *line(f"-grid_n {n} -grid_length {n} -init_type sine -ts_type rk -ts_rk_type 5dp "
                                                              "-ts_max_steps 2")],
                                       capture_output=True, text=True, check=True).stdout) for n in (100000, 400000)]
    each = (peaks[1] - peaks[0]) / 300000
    check(each < 90, f"{each} bytes a node")

"""The lists of `spectrum` against numpy on a dense matrix built from the equations: a list that is called whole has no hole,
and one that is not says how many eigenvalues are missing."""
import json
import re

import h5py
import numpy as np

import reference
from calls import call, run

from . import sliding


def holes(found, dense, tolerance):
    """Eigenvalues of the matrix right of the last one listed that the list lacks, by pairing each listed one."""
    last = min(z.real for z in found)
    left = [z for z in dense if z.real > last - tolerance]
    for z in found:
        nearest = min(range(len(left)), key=lambda k: abs(left[k] - z), default=None)
        assert nearest is not None and abs(left[nearest] - z) < tolerance, f"{z} is no eigenvalue of the matrix"
        del left[nearest]
    return [z for z in left if z.real > last + tolerance]


def check(index, p, method):
    words = ["-spectrum_method", method, "-spectrum_refine", "off", *reference.words(p)]
    done = call(["-out_file", "s.h5", "-summary", "s.json", *words], command="spectrum")
    if done.returncode == 1 and "no steady sliding" in done.stderr:
        return None
    assert done.returncode == 0, f"scene {index}: {words}: {done.stderr}"
    with open("s.json", encoding="utf-8") as file:
        summary = json.load(file)
    with h5py.File("s.h5") as file:
        a = reference.amplitudes(p, file["steady_psi"][...], file["steady_eta"][...])
    dense = reference.System(p, a).eigenvalues()
    # numpy's own error: round-off of the norm, times the condition of trapped modes
    scale = np.abs(dense).max()
    tolerance = 1e-6 * scale
    found = [complex(e["re"], e["im"]) for e in summary["eigenvalues"]]
    text = f"scene {index}: {' '.join(words)}: {summary['completeness_check']}"
    missing = holes(found, dense, tolerance)
    if summary["complete"]:
        assert abs(summary["growth_rate"] - dense.real.max()) < tolerance or p.get("model_k0", 1) == 0, text
    if summary["list_complete"]:
        assert not missing and summary["missing"] == 0, f"{text}: lacks {missing}"
    elif summary["missing"] is not None:
        total, line_at = re.findall(r"(\d+) eigenvalues with real part above ([-+.e\d]+)", summary["completeness_check"])[-1]
        near = np.abs(dense.real - float(line_at)) < 1e-5 * (1 + abs(float(line_at)))
        assert abs(int(total) - np.sum(dense.real > float(line_at))) <= np.sum(near), text
    return summary["list_complete"]


def test_lists_have_no_holes(scenes):
    whole = [check(index, p, ("krylov", "auto")[index % 2]) for index, p in scenes(sliding.scene, 31, short=8)]
    whole = [w for w in whole if w is not None]
    assert len(whole) > 6 and np.mean(whole) > 0.97, f"{whole.count(True)} of {len(whole)} lists are whole"


def ring(random):
    """A ring whose friction repeats with a period of 2 or 4 blocks, so that most values have two shapes, of any two of a
    Krylov space: size, amplitudes, v, k0, k1, eigenvalues wanted."""
    amplitudes = random.uniform(0.4, 1.3, random.choice([2, 4]))
    n = 4 * int(random.integers(10, 61))
    return n, amplitudes, random.uniform(0.2, 1.2), random.uniform(0.05, 1), random.uniform(0.1, 2), int(random.integers(6, 31))


def check_ring(index, n, amplitudes, v, k0, k1, count, method):
    a = np.resize(amplitudes, n)
    np.savetxt("a.txt", np.stack([np.arange(n), a], axis=1), fmt="%.17g")
    summary, _ = run(f"-model_form chain -grid_n {n} -friction_amplitude_profile a.txt -model_v {v!r} -model_k0 {k0!r} "
                     f"-model_k1 {k1!r} -spectrum_count {count} -spectrum_method {method}", command="spectrum")
    one = np.eye(n)
    pull = -k0 * one + k1 * (np.roll(one, 1, 0) + np.roll(one, -1, 0) - 2 * one)
    dense = np.linalg.eigvals(np.block([[np.diag(-a * (v * v - 1)), one], [pull, 0 * one]]))
    found = [complex(e["re"], e["im"]) for e in summary["eigenvalues"]]
    missing = holes(found, dense, 1e-6)  # a value that stands too often in the list is no eigenvalue of the rest
    if summary["list_complete"]:
        assert not missing and summary["missing"] == 0, f"ring {index}: lacks {missing}: {summary['completeness_check']}"
    return not missing


def test_rings_of_double_values(scenes):
    right = [check_ring(index, *r, ("krylov", "auto")[index % 2]) for index, r in scenes(ring, 32, short=2)]
    assert np.mean(right) > 0.9, f"{sum(right)} of {len(right)} lists have no hole"


def test_the_list_does_not_depend_on_the_number_of_ranks():
    words = ("-model_form chain -model_k0 0.338 -model_k1 0.968 -model_zeta 0.262 -friction_law carlson-langer "
             "-friction_spread 0.267 -friction_seed 38 -model_v 0.401 -grid_n 81 -spectrum_method krylov")
    one, _ = run(words, command="spectrum")
    two, _ = run(words, ranks=2, command="spectrum")
    assert one["list_complete"] is True and len(one["eigenvalues"]) == len(two["eigenvalues"])
    for a, b in zip(one["eigenvalues"], two["eigenvalues"]):
        assert abs(a["re"] - b["re"]) < 1e-12 and abs(a["im"] - b["im"]) < 1e-12


def test_the_mode_that_was_missing():
    words = ("-grid_n 172 -model_v .963 -bc_left velocity -bc_right velocity -bc_left_value -.28 -friction_law cubic "
             "-state_law contact-age -state_D .595 -state_theta0 2.784 -state_b .816 -model_gamma .638 -model_c 3.883 "
             "-grid_length 34.07 -grid_order 6 -model_delta 0 -spectrum_refine off")
    summary, _ = run(words, command="spectrum")
    assert summary["list_complete"] is True and summary["missing"] == 0
    assert any(abs(complex(e["re"], e["im"]) - (0.140227 + 30.686j)) < 1e-3 for e in summary["eigenvalues"])


def test_a_crowd_of_real_modes():
    words = ("-model_v 0.2330880473397432 -grid_n 100 -bc_left velocity -bc_right velocity -friction_law rate-and-state "
             "-state_law slip -friction_a 0.1601037 -friction_b 0.1425757 -friction_D 1.6087221 -model_gamma 1.950018 "
             "-model_c 1.7529658 -model_delta 0 -grid_length 8.066343 -grid_order 6")
    dense, _ = run(words + " -spectrum_method dense", command="spectrum")
    krylov, _ = run(words + " -spectrum_method krylov", command="spectrum")
    assert abs(dense["growth_rate"] - krylov["growth_rate"]) < 1e-9 and krylov["complete"] is True

"""Fields in files, which rank 0 writes from pieces of the ranks that own them: the same bits on any number of ranks, and no
rank that holds more than its part."""
import functools
import glob
import os
import subprocess

import numpy as np
import pytest

from calls import check, data, line, run

FIXED = "-ts_adapt_type none -ts_dt 0.01 -out_frames 5 "
# sums over the ranks differ in round-off, fields do not
FIELDS = ("x", "t", "psi", "eta", "chi", "theta", "probes/psi", "probes/eta")


def same_fields(reference, path, name, frames=None):
    """`frames`: of the reference's so many are there, the last ones; None: all."""
    found = data(path)
    check(found.keys() == reference.keys(), f"{name}: datasets")
    for key in set(FIELDS) & reference.keys():
        last = reference[key][-frames:] if frames and key != "x" else reference[key]
        check(np.array_equal(found[key], last), f"{name}: {key} differs")


@pytest.mark.ranks
@pytest.mark.parametrize("scene", [
    "-grid_n 61 -init_type sine -bc_left free -ts_max_time 0.3 -out_displacement -out_probes 0,1.3,50",
    "-grid_n 200 -friction_law rate-and-state -init_type sine -init_mode 3 -ts_max_time 0.1",
    "-grid_n 64 -init_type sine -init_mode 4 -ts_max_time 0.2",            # cells of 16 nodes
    "-grid_n 300000 -grid_length 15000 -ts_max_time 0.02",                 # one node for all
    "-grid_n 300000 -grid_length 15000 -init_type sine -init_mode 2 -ts_max_time 0.02",  # two cells of 150000
])
def test_same_bits_on_any_ranks(scene):
    run(f"{FIXED}{scene} -out_file one.h5")
    reference = data("one.h5")
    for ranks in (2, 3):
        run(f"{FIXED}{scene} -out_file many.h5", ranks)
        same_fields(reference, "many.h5", f"{scene} on {ranks} ranks")


@pytest.mark.ranks
def test_restart_on_other_ranks():
    # in the last quarter there are ranges of every node, off a ring passages besides
    for ends in ("periodic", "free"):
        scene = f"{FIXED}-grid_n 301 -init_type sine -bc_left {ends} -ts_max_time 1 -out_checkpoint_every 20"
        one, _ = run(f"{scene} -out_file one.h5")
        run(f"{scene} -out_file three.h5 -out_checkpoint_keep 9", 3)
        reference = data("one.h5")
        same_fields(reference, "three.h5", ends)
        for step, frames, ranks in ((40, 3, 2), (80, 1, 2), (80, 1, 1)):
            found, _ = run(f"-restart three.chk-{step:06d}.h5 -out_file again{step}-{ranks}.h5", ranks)
            same_fields(reference, f"again{step}-{ranks}.h5", f"{ends}, from step {step} on {ranks} ranks", frames)
            for key in ("amplitude", "pulses", "regime", "wave_speed", "psi_max"):
                a, b = found[key], one[key]
                near = a == b or (isinstance(a, float) and isinstance(b, float) and abs(a - b) < 1e-11)
                check(near, f"{ends}, from step {step} on {ranks} ranks: {key} {a} {b}")
        for old in glob.glob("*.h5"):
            os.remove(old)


@pytest.mark.ranks
def test_displacement_piece_by_piece():
    """From 50000 nodes on each rank solves for its nodes and those that they feel; a banded solve of condition
    1 + 4 K1/(K0 h^2), here below 1e4, errs by 1e-12."""
    for scene in ("-grid_length 2000 -init_type sine -init_mode 3", "-grid_length 3000 -bc_left velocity -bc_left_value 0.4 -bc_right free",
                  "-model_form chain -model_k1 4"):
        line_ = f"{FIXED}-grid_n 50000 {scene} -ts_max_time 0.03 -out_displacement -out_frames 2 -out_file "
        run(line_ + "one.h5")
        run(line_ + "two.h5", 2)
        one, two = data("one.h5"), data("two.h5")
        check(np.array_equal(one["psi"], two["psi"]), f"{scene}: psi")
        apart = abs(one["chi"] - two["chi"]).max()
        check(apart < 1e-12 * max(1, abs(one["chi"]).max()), f"{scene}: chi differs by {apart}")


def peak(arguments, ranks):
    """What the largest rank holds of a scene, in bytes: its resident memory beyond that of as many ranks with a short line,
    which is the program's, MPI's and the libraries' (MPI takes 3 to 4 MB more where there are several ranks)."""
    return resident(arguments, ranks) - resident_of_a_short_line(ranks)


@functools.cache
def resident_of_a_short_line(ranks):
    return resident("-grid_n 5000 -grid_length 250 -init_type sine -ts_max_time 0.01 -ts_dt 0.005 -ts_adapt_type none "
                    "-out_frames 2 -out_file short.h5", ranks)


def resident(arguments, ranks):
    process = subprocess.Popen(line(arguments, ranks), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    check(status == 0, f"{arguments} on {ranks} ranks: {said}")
    return 1024 * used.ru_maxrss


@pytest.mark.ranks
def test_no_rank_holds_what_another_watches(request):
    """The catalogue of events, in which every node moves; the long version also has held ends, profiles, spread and the
    displacement, of which a rank solves for its own nodes and some at either side. 40 bytes for each own node are less than
    two arrays of global length on four ranks."""
    long = (request.config.getoption("--scenes") or 0) >= 200
    own = 2_500_000 if long else 150_000
    held = "-bc_left velocity -bc_left_value 0.3 -bc_right velocity -init_type layer -init_width 20"
    scenes = ["-init_type sine -out_events true"]
    if long:
        scenes += [held, "-init_type sine -friction_amplitude_profile 0:1,100:1.2,200:1", "-init_type sine -friction_spread 0.1",
                   f"{held} -out_displacement true"]
    for scene in scenes:
        peaks = [peak(f"-grid_n {own * ranks} -grid_length {own * ranks // 20} {scene} -ts_max_time 0.01 -ts_dt 0.005 "
                      "-ts_adapt_type none -out_frames 2 -out_file watched.h5", ranks) for ranks in (1, 4)]
        check(peaks[1] < peaks[0] + 40 * own, f"{peaks[1] / 1e6} MB on four ranks, {peaks[0] / 1e6} MB on one: {scene}")


@pytest.mark.ranks
def test_no_rank_holds_a_field(request):
    """Four ranks need what one rank with as many nodes as each of them needs: an array of global length on any of them
    would be 24 bytes more for each own node; what MPI keeps of its own to carry pieces to the rank that writes is up to 7 MB,
    whatever the length (Open MPI 6). The long version (./check audit) has 1e7 nodes in all."""
    own = 2_500_000 if (request.config.getoption("--scenes") or 0) >= 200 else 500_000
    def scene(n):
        return (f"-grid_n {n} -grid_length {n // 20} -init_type sine -ts_max_time 0.01 -ts_dt 0.005 -ts_adapt_type none "
                "-out_frames 2 -out_checkpoint_every 1")
    one = peak(f"{scene(own)} -out_file one.h5", 1)
    four = peak(f"{scene(4 * own)} -out_file four.h5", 4)
    check(four < one + 18 * own, f"{four / 1e6} MB on four ranks, {one / 1e6} MB on one")
    start = next(iter(sorted(glob.glob("one.chk*"))))
    one = peak(f"-restart {start} -ts_max_time 0.015 -out_file again1.h5", 1)
    start = next(iter(sorted(glob.glob("four.chk*"))))
    four = peak(f"-restart {start} -ts_max_time 0.015 -out_file again4.h5", 4)
    check(four < one + 18 * own, f"{four / 1e6} MB on four ranks, {one / 1e6} MB on one: restart")

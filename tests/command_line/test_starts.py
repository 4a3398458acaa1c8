"""Starts from text in columns, from NetCDF-4 and HDF5 files of others, and from runs on other grids: the nodes' own values
where the points are the nodes, cubics between other points, a warning that says so, and what is refused."""
import h5py
import numpy as np
import pytest
import xarray

from calls import call, check, data, refused, run

OPEN = "-bc_left free -grid_n 41 -grid_length 10 -ts_max_time 0.01 -out_frames 2 -out_file start.h5 "
RING = "-grid_n 60 -grid_length 30 -ts_max_time 0.01 -out_frames 2 -out_file start.h5 "


def cubic(x):
    return 0.1 + 0.03 * x - 0.02 * x ** 2 + 1e-3 * x ** 3


def write(name, *columns):
    np.savetxt(name, np.array(columns).T, header="x psi eta", fmt="%.17g")


def first(options):
    s, _ = run(options)
    found = data("start.h5")
    return s, {name: values[0] if np.ndim(values) == 2 else values for name, values in found.items()}


def test_text_on_the_nodes():
    x = np.linspace(0, 10, 41)
    draw = np.random.default_rng(1).uniform
    psi, eta = draw(-1, 1, 41), draw(-1, 1, 41)
    write("start.txt", x, psi, eta)
    s, found = first(OPEN + "-init_type text -init_file start.txt")
    check(np.array_equal(found["psi"], psi) and np.array_equal(found["eta"], eta), "other values")
    check(not any("interpolated" in w for w in s["warnings"]), s["warnings"])


def test_text_between_points():
    # cubics come back to round-off, of an age those of its logarithm
    x = np.sort(np.concatenate([[0, 10], np.random.default_rng(2).uniform(0, 10, 12)]))
    write("start.txt", x, cubic(x), cubic(x) / 2, np.exp(5 * cubic(x)))
    s, found = first(OPEN + "-init_type text -init_file start.txt -friction_law rate-and-state")
    nodes = found["x"]
    for name, exact in (("psi", cubic(nodes)), ("eta", cubic(nodes) / 2), ("theta", np.exp(5 * cubic(nodes)))):
        check(np.allclose(found[name], exact, rtol=1e-10, atol=1e-12), f"{name}: {abs(found[name] - exact).max()}")
    check(any("14 points" in w and "interpolated" in w for w in s["warnings"]), s["warnings"])


def ring_error(n, closed):
    x = np.arange(n + closed) * 30 / n
    write("start.txt", x, np.sin(2 * np.pi * x / 30), np.cos(2 * np.pi * x / 30))
    _, found = first(RING + "-init_type text -init_file start.txt")
    return abs(found["psi"] - np.sin(2 * np.pi * found["x"] / 30)).max()


def test_ring_goes_round():
    # the cubic through four points h apart misses a sine by at most (3/128) (k h)^4 between the middle two
    for closed in (0, 1):
        coarse, fine = ring_error(22, closed), ring_error(44, closed)
        bound = 3 / 128 * (2 * np.pi / 22) ** 4
        check(coarse < 1.01 * bound and fine < 1.01 * bound / 16, f"{coarse} and {fine} for {bound}")


def test_netcdf():
    x = np.linspace(0, 10, 25)
    fields = {"psi": ("x", cubic(x)), "eta": ("x", 2 * cubic(x))}
    xarray.Dataset(fields, coords={"x": x}).to_netcdf("one.nc", engine="h5netcdf")
    _, found = first(OPEN + "-init_type file -init_file one.nc")
    check(np.allclose(found["psi"], cubic(found["x"]), atol=1e-12), "psi of x")
    frames = np.array([cubic(x), 3 * cubic(x), 5 * cubic(x)])
    fields = {"psi": (("time", "x"), frames), "eta": (("time", "x"), -frames)}
    xarray.Dataset(fields, coords={"x": x, "time": [0., 1, 2]}).to_netcdf("several.nc", engine="h5netcdf")
    for frame, factor in (("", 5), ("-init_frame 1", 3)):
        _, found = first(OPEN + "-init_type file -init_file several.nc " + frame)
        check(np.allclose(found["eta"], -factor * cubic(found["x"]), atol=1e-12), f"{frame}: another frame")


def test_run_on_another_grid():
    run("-grid_n 96 -grid_length 30 -init_type sine -ts_max_time 0.5 -out_file coarse.h5 -out_frames 2 -scene_reduce off")
    coarse = data("coarse.h5")
    s, found = first(RING.replace("60", "192") + "-init_type file -init_file coarse.h5")
    check(np.allclose(found["psi"][::2], coarse["psi"][-1], rtol=0, atol=1e-14), "the common nodes differ")
    check(any("96 points" in w for w in s["warnings"]), s["warnings"])


REFUSED = [("-init_type text", "", "needs init_file"),
           ("-init_type text -init_file t.txt", "0 1\n1 2\n", "2 columns"),
           ("-init_type text -init_file t.txt", "0 1 2\n1 2 x\n", "t.txt:2"),
           ("-init_type text -init_file t.txt", "0 1 2 3\n5 1 2 3\n7 1 2 3\n10 1 2 3\n", "no state"),
           ("-init_type text -init_file t.txt", "0 1 2\n5 1 2\n4 1 2\n10 1 2\n", "ascend"),
           ("-init_type text -init_file t.txt", "0 1 2\n5 1 2\n10 1 2\n", "four"),
           ("-init_type text -init_file t.txt", "0 1 2\n3 1 2\n5 1 2\n8 1 2\n", "cover"),
           ("-init_type text -init_file t.txt", "0 1 2\n3 1 2\n5 1 2\n12 1 2\n", "cover"),
           ("-init_type text -init_file t.txt -friction_law rate-and-state", "0 1 2\n3 1 2\n5 1 2\n10 1 2\n", "no theta"),
           ("-init_type text -init_file t.txt -friction_law rate-and-state", "0 1 2 1\n3 1 2 -1\n5 1 2 1\n10 1 2 1\n", "theta = -1"),
           ("-init_type text -init_file t.txt -init_frame 0", "0 1 2\n", "init_frame"),
           ("-init_type file -init_file t.txt", "0 1 2\n", "t.txt")]


@pytest.mark.parametrize("options, text, part", REFUSED)
def test_refused(options, text, part):
    with open("t.txt", "w", encoding="ascii") as file:
        file.write(text)
    refused("-bc_left free -grid_length 10 -grid_n 41 " + options, 2, part)


def test_refused_files():
    write("c.txt", np.arange(5.), np.zeros(5), np.zeros(5))
    refused("-model_form chain -grid_n 9 -init_type text -init_file c.txt", 2, "blocks")
    with h5py.File("bare.h5", "w") as file:
        file["x"] = np.arange(5.)
        file["psi"] = np.arange(5.)
    refused("-bc_left free -grid_length 4 -grid_n 5 -grid_order 2 -init_type file -init_file bare.h5", 2, "eta")


@pytest.mark.parametrize("scene", [
    "-model_form chain -grid_n 3 -bc_left velocity -bc_left_value 0.4 -model_v 0.935 -model_k0 0.3 -model_k1 0.2 -model_zeta 0.3",
    "-model_form chain -grid_n 6 -bc_left velocity -bc_left_value 0.4 -bc_right velocity -bc_right_value 1.2 -model_v 1.1 "
    "-model_nu 0.3 -friction_law carlson-langer -model_zeta 0.9 -state_law healing",
    "-grid_n 200 -bc_left velocity -bc_left_value -1.2 -model_v -1.1 -model_nu 0.3 -grid_order 6",
    "-grid_n 120 -bc_left free -bc_right velocity -bc_right_value 1.3 -model_v 1.1 -friction_spread 0.2"])
def test_steady_beside_held_ends(scene):
    # psi of (K0 - K1 D2)(psi - v) = 0, as `spectrum` solves it, and a start that stays where it is
    s, _ = run(f"{scene} -init_psi steady -init_eta steady -ts_max_time 2 -out_frames 2 -out_file r.h5")
    run(scene + " -out_file s.h5", command="spectrum")
    with h5py.File("r.h5") as file, h5py.File("s.h5") as sliding:
        psi, eta = file["psi"][()], file["eta"][()]
        inside = slice(1, -1)
        check(np.allclose(psi[0], sliding["steady_psi"], rtol=0, atol=1e-12), "psi")
        check(np.allclose(eta[0, inside], sliding["steady_eta"][inside], rtol=0, atol=1e-12), "eta")
        check(np.ptp(psi[0]) > 0.05 and abs(psi[1] - psi[0]).max() < 1e-10, "at rest beside it")
        if "spread" in scene:
            check(np.ptp(file["friction_amplitude"]) > 0.1, "the amplitudes drawn")
    check(not any("fit" in w for w in s["warnings"]), s["warnings"])


def test_no_steady_sliding_is_said():
    # a contact held at rest ages for ever
    s, _ = run("-grid_n 32 -bc_left velocity -bc_left_value 0 -model_v 1 -friction_law rate-and-state -init_psi steady "
               "-ts_max_time 0.1")
    check(any("no steady sliding" in w for w in s["warnings"]), s["warnings"])


def test_noise_of_either():
    # The same draw, added to what the start is without it; a chain at rest with eta uniform on [0, 1] has it in eta.
    chain = "-model_form chain -grid_n 50 -friction_law coulomb -init_psi 0 -init_eta 0.5 -init_noise 0.5 -ts_max_time 0 -out_frames 2 -out_file start.h5"
    _, of_psi = first(chain)
    _, of_eta = first(chain + " -init_noise_of eta")
    check(np.allclose(of_eta["eta"] - 0.5, of_psi["psi"], rtol=0, atol=1e-15) and not of_eta["psi"].any(), "the draw of psi")
    check(0 <= of_eta["eta"].min() < 0.1 and 0.9 < of_eta["eta"].max() <= 1 and np.all(of_psi["eta"] == 0.5), "uniform on [0, 1]")
    refused("-model_form chain -model_m 0 -model_zeta 1 -grid_n 5 -init_noise 0.1 -init_noise_of eta -ts_max_time 1", 2, "init_noise_of")


BLOCK = "-model_form chain -grid_n 1 -bc_left free -ts_max_time 1e-3 -out_frames 2 -out_file start.h5 "


@pytest.mark.parametrize("words, psi, eta", [
    ("", 0.1, 0.1), ("-init rest", 0, 0), ("-friction_law coulomb", 0, 0), ("-friction_law coulomb -init_psi 0.3", 0.3, 0),
    ("-friction_law coulomb -init_eta 0.2", 0, 0.2), ("-friction_law tanh", 0.1, 0.1), ("-friction_law tanh -init rest", 0, 0),
    # on sliding at v = 0.2 with the cubic law eta is F(0.2), with Coulomb's 0.5
    ("-init sliding", 0.2, 0.2 ** 3 / 3 - 0.2), ("-friction_law coulomb -init sliding", 0.2, 0.5),
    ("-friction_law coulomb -init sliding -init_psi 0.7", 0.7, 0.5)])
def test_rest_or_sliding(words, psi, eta):
    _, found = first(BLOCK + words)
    check(abs(found["psi"][0] - psi) < 1e-14 and abs(found["eta"][0] - eta) < 1e-12, (words, found["psi"], found["eta"]))


def test_a_table_begins_at_rest():
    np.savetxt("curve.txt", [[0, 0.6], [1, 0.4], [2, 0.5]])
    _, found = first(BLOCK + "-friction_law table -friction_table curve.txt")
    check(found["psi"][0] == 0 and found["eta"][0] == 0, found)


def test_where_the_start_decides_the_closing_line_says_so():
    """Between its linear boundary and grazing the block of Carlson and Langer does either (theory.md, where stick-slip ends:
    1.659 and 2.405 at zeta = sqrt(0.02))."""
    scene = "-model_form chain -grid_n 1 -bc_left free -friction_law carlson-langer -model_zeta paper -model_k1 0.2 "
    for v, told in ((1.8, True), (2.6, False)):
        done = call(f"{scene} -model_v {v} -init sliding -ts_max_time 60 -progress auto")
        check(("from rest it sticks and slips" in done.stderr) == told and "sliding" in done.stderr, done.stderr)
    s, _ = run(f"{scene} -model_v 1.8 -ts_max_time 200")
    check(s["regime"] == "stick-slip", s["regime"])

"""The word for where a motion goes, on motions that look like another one: slow decay, loading, rest, starts that are
exactly steady. Random scenes stand in tests/audit/test_regime.py."""
import glob

import numpy as np
import pytest
from calls import call, data, run, scene_file

BLOCK = "-model_form chain -grid_n 1 -bc_left free -init_psi 0 -init_eta 0 "
CARLSON_LANGER = BLOCK + "-friction_law carlson-langer -model_v .01 -model_k0 1 "
LOADED_CHAIN = ("-model_form chain -friction_law coulomb -model_v 0.001 -model_k0 0.2 -model_k1 1 -grid_n 50 "
                "-bc_left free -init_psi 0 -init_eta 0 -friction_spread 0.3 -friction_seed 3 ")
CATALOGUE = scene_file("catalogue") + " -grid_n 20 -model_v 1e-4 -out_events false "


def regime(arguments):
    out, said = run(arguments)
    decided = out["regime"] in ("sliding", "stick-slip", "stuck")
    assert (out["time_to_decide"] is None) == decided, f"{arguments}: {out['regime']} {out['time_to_decide']}"
    assert decided or out["time_to_decide"] > out["t_end"], f"{arguments}: {out['time_to_decide']}"
    return out, said


@pytest.mark.parametrize("end, word", [(60, "decaying"), (150, "decaying"), (300, "decaying"), (1000, "sliding")])
def test_slow_decay(end, word):
    # the spectrum: -0.004, below the -0.0055 of an amplitude that still feels the cube
    out, _ = regime(f"-model_gamma 0.3 -model_v 0.6 -ts_max_time {end} -ts_rtol 1e-8 -ts_atol 1e-8")
    assert out["regime"] == word and abs(out["growth_rate"] + 0.004) < 1e-9, out
    assert end < 300 or abs(out["regime_rate"] + 0.004) < 4e-4, out


@pytest.mark.parametrize("scene, loaded", [
    # loading from rest to the threshold: 1/(k0 v)
    (CARLSON_LANGER + "-ts_max_time 50", 100),
    (LOADED_CHAIN + "-ts_max_time 1000", None),
    ("-model_form chain -friction_law carlson-langer -model_v .01 -grid_n 50 -bc_left free -init_psi 0 -init_eta 0 "
     "-init_noise 1e-3 -ts_max_time 60", 500),
    (BLOCK + "-friction_law rate-and-state -state_law ageing -init_psi 5e-18 -model_v 1e-3 -ts_max_time 300", None)])
def test_loaded_too_short(scene, loaded):
    out, said = regime(scene)
    assert out["regime"] == "undecided" and "nothing has slipped yet: loading takes until about t = " in said, said
    until = float(said.split("until about t = ")[1].split(",")[0])
    assert until > out["t_end"] and (loaded is None or abs(until / loaded - 1) < 0.01), said


def test_loaded_block_slips():
    # an integration from event to event: slips at 100, 115.52, 131.05, 146.57, each of 4.86; then every 15.52
    assert regime(CARLSON_LANGER + "-ts_max_time 130")[0]["regime"] == "undecided"
    assert regime(CARLSON_LANGER + "-ts_max_time 150")[0]["regime"] == "stick-slip"
    assert regime(CARLSON_LANGER + "-ts_max_time 450")[0]["regime"] == "stick-slip"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_irregular_slips(seed):
    # 20 blocks, loaded in 1e4: large and small events without a trend. Ten times as long need not decide; what it says
    # would do so does, to a factor of two, and the motion stays what it is.
    scene = f"{CATALOGUE} -init_seed {seed} -ts_max_time "
    out, _ = regime(scene + "100000")
    wanted = out["time_to_decide"] or 100000
    assert out["regime"] in ("undecided", "stick-slip") and wanted <= 400000, out
    for end in (2 * wanted, 800000):
        assert regime(f"{scene} {end}")[0]["regime"] == "stick-slip", end


@pytest.mark.parametrize("end", [0.3, 1, 10])
def test_on_its_way(end):
    out, _ = regime(f"-model_gamma 1000 -model_v 0.2 -ts_max_time {end} -init_psi 1.9 -init_eta 0.4")
    assert out["regime"] == "undecided", out


@pytest.mark.parametrize("end", [1200, 4800])
def test_first_events(end):
    assert regime(f"{CATALOGUE} -ts_max_time {end}")[0]["regime"] == "undecided"


@pytest.mark.parametrize("start", ["-init_psi 0 -init_eta 0", "-init_psi 0.3 -init_eta 0.5 -init_noise 0.2"])
def test_unloaded_rest(start):
    out, _ = regime("-model_form chain -friction_law carlson-langer -model_v 0 -grid_n 50 -bc_left free "
                    f"-ts_max_time 100 {start}")
    assert out["regime"] == "stuck", out


def test_exactly_steady():
    steady = "-init_psi steady -init_eta steady "
    assert regime(steady + "-model_v 1.2")[0]["regime"] == "sliding"
    # psi = v to the last bit, and unstable: it goes where no round-off has yet led it
    assert regime(steady + "-model_v 0.5")[0]["regime"] == "undecided"


@pytest.mark.parametrize("scene", [
    "-model_form chain -grid_n 20 -bc_left free -friction_law carlson-langer -friction_spread 0.3 -model_zeta 0.4",
    "-friction_spread 0.2 -grid_n 40 -bc_left free -model_v 0.9", "-bc_left velocity -bc_left_value -1.5 -grid_n 30",
    "-model_form chain -grid_n 12 -bc_left velocity -bc_right velocity -bc_left_value 0.5 -friction_law "
    "rate-and-state -friction_spread 0.2"])
def test_growth_where_nodes_differ(scene):
    got, _ = run(scene + " -ts_max_time 1")
    exact, _ = run(scene + " -spectrum_count 2", command="spectrum")
    assert got["growth_rate_reason"] is None and abs(got["growth_rate"] - exact["growth_rate"]) < 1e-8, exact


@pytest.mark.parametrize("scene, why", [
    ("-friction_spread 0.2 -grid_n 400", "800 unknowns"),
    ("-model_form chain -friction_law coulomb -model_v 0 -grid_n 4 -bc_left free", "jumps at psi = 0"),
    ("-model_v 0 -friction_law rate-and-state -grid_n 8", "no steady sliding")])
def test_growth_unknown(scene, why):
    got, _ = run(scene + " -ts_max_time 0.5")
    assert got["growth_rate"] is None and why in got["growth_rate_reason"], got


TWO_FREE_BLOCKS = ("-model_form chain -grid_n 2 -bc_left free -friction_law cubic -model_v 0.8034 -state_law contact-age "
                   "-state_b 0.4837 -state_D 3.143 -state_theta0 2.561 -model_m 2.561 -model_k0 0.3465 -model_k1 2 -model_f0 1.334 "
                   "-model_zeta 0.6765 -init_psi 0.9 -init_eta steady -init_noise 0.05 -ts_max_time 20000")
FINITE_WAVE = scene_file("viscous-wavelength") + " -out_frames 2 "


def test_growth_rate_is_that_of_the_waves_that_fit():
    # of two free blocks that is the uniform wave and one more; between them others would grow
    out, _ = regime(TWO_FREE_BLOCKS)
    assert out["regime"] == "sliding" and abs(out["growth_rate"] + 4.998653e-4) < 1e-9, out
    # and of a long ring the peak between long waves and short ones, as `spectrum` has it
    for v in (0.8883, 0.8963):
        found = run(f"{FINITE_WAVE} -grid_n 700 -model_v {v}", command="spectrum")[0]
        out, _ = regime(f"{FINITE_WAVE} -grid_n 700 -model_v {v} -ts_max_time 2")
        assert abs(out["growth_rate"] - found["growth_rate"]) < 1e-9 and out["growth_rate"] > 0.02, out
        assert out["regime"] != "sliding", out


@pytest.mark.parametrize("scene", [
    "-grid_n 3 -friction_law coulomb -friction_stick regularised -friction_eps 0.05 -model_v 0.8562 "
    "-friction_slip_velocity 0.5688 -state_law healing -state_t_h 1.579 -state_tau_inf 1.8761 -state_D 0.9358 "
    "-bc_left velocity -bc_left_value 0.4286 -model_form chain -model_m 1.646 -model_k0 1.042 -model_k1 0.1017 "
    "-model_f0 0.6333 -model_zeta 0.1121 -model_nu 0.07304 -ts_max_time 325.74 -init_psi 0.840371 -init_eta steady "
    "-init_type sine -init_amplitude 0.012697 -init_mode 2",
    FINITE_WAVE + "-model_v 0.85 -grid_length 1.8 -grid_n 128 -init_noise 1e-2 -init_noise_length 0.2 -ts_max_time 400"])
def test_nothing_decays_to_unstable_sliding(scene):
    # saturated or bursting oscillations whose last trend falls
    out, _ = regime(scene)
    assert out["growth_rate"] > 0 and out["regime"] not in ("decaying", "sliding"), out


def test_noise_of_settled_sliding():
    # 69 decay times, of which error control has kept an amplitude of 2e-4
    out, _ = regime("-model_v 0.8256503403268804 -grid_n 30 -friction_law rate-and-state -state_law ageing -friction_a "
                    "0.028640914167628206 -friction_b 0.12647335055469486 -friction_D 1.8324513297185094 -model_gamma "
                    "1.4386143472817996 -model_c 1.5806041383582425 -model_delta 0.06079175508211032 -grid_length 21.353658 "
                    "-grid_order 6 -scene_reduce off -init_psi 0.83 -init_eta steady -init_noise 0.008 -ts_max_time 2000")
    assert out["regime"] == "sliding" and out["amplitude"] > 1e-5, out


# ---- rests ----

SLIDER = "-model_form chain -grid_n 1 -bc_left free -friction_law carlson-langer"


@pytest.mark.parametrize("law, tolerance", [("", 1e-6), ("-friction_stick regularised -friction_eps 1e-3", 5e-3)])
def test_rest_fraction_is_the_cycles(law, tolerance):
    """Whole periods in the last quarter, so that where it begins does not matter; with regularised friction up to the steps at
    the ends of a rest."""
    scene = f"{SLIDER} -model_v 0.5 -model_zeta 0.1 {law}"
    cycle, _ = run(scene, command="cycle")
    found, said = run(f"{scene} -ts_max_time {4 * 5 * cycle['period']!r} -ts_rtol 1e-9 -ts_atol 1e-10")
    assert found["regime"] == "stick-slip" and 0.1 < cycle["rest_fraction"] < 0.9
    assert found["rest_fraction"] == pytest.approx(cycle["rest_fraction"], abs=tolerance)
    alike, _ = run(f"{scene} -grid_n 5 -scene_reduce off -model_k1 0 -ts_max_time {4 * 5 * cycle['period']!r} -ts_rtol 1e-9 "
                   "-ts_atol 1e-10", 2)
    assert alike["rest_fraction"] == pytest.approx(found["rest_fraction"], abs=tolerance)


@pytest.mark.parametrize("steps", ["", "-ts_rtol 1e-9 -ts_atol 1e-9"])
def test_rest_begins_and_ends_within_steps(steps):
    """Regularised friction at usual tolerances; 0.24611 by scipy's Radau at 1e-10."""
    s, _ = run(f"-model_form chain -grid_n 1 -bc_left free -friction_law coulomb -friction_fd .87 -friction_stick regularised "
               "-friction_eps .036 -friction_slip_velocity .2 -model_m 1.7 -model_k0 .47 -model_f0 .73 -model_zeta .054 -model_v .4 "
               f"-ts_max_time 140 {steps}")
    assert s["rest_fraction"] == pytest.approx(0.24611, abs=1e-4)


LABORATORY = ("-model_form chain -grid_n 1 -bc_left free -friction_law rate-and-state -friction_a 0.05 -friction_b 0.12 -friction_D 0.5 "
              "-model_k0 0.05 -model_v 0.5 -ts_max_time 400")


@pytest.mark.parametrize("scene", [f"{SLIDER} -model_v 0.5 -model_zeta 0.1 -ts_max_time 400", LABORATORY,
                                   f"{SLIDER} -model_v 0.5 -model_zeta 0.1 -friction_stick regularised -friction_eps 3e-2 -ts_max_time 400"])
def test_period_has_the_digits_of_its_error(scene):
    """It lies within its error of that of fine steps, which is small beside it, and its number ends with the error's fourth digit;
    with a probe it is the same."""
    found, at_probe = run(scene)[0], run(f"{scene} -out_probes 0")[0]
    fine, _ = run(f"{scene} -ts_rtol 1e-11 -ts_atol 1e-12")
    for s in (found, at_probe):
        period, error = s["period"], s["period_error"]
        assert abs(period - fine["period"]) <= error < 1e-3 * period, (period, error, fine["period"])
        digits = 3 - int(np.floor(np.log10(error)))
        assert period == round(period, digits), (period, error)
    assert fine["period_error"] < found["period_error"]  # what is left there is how far the motion has still to settle


def test_held_ends_are_no_blocks_that_wait():
    """The one block between them slips and rests in turn, as it does between more blocks."""
    for n in (3, 4):
        s, _ = run(f"-model_form chain -friction_law coulomb -grid_n {n} -bc_left velocity -bc_right velocity -model_v .1 -model_k0 1 "
                   "-model_k1 .3 -init_psi 0 -init_eta 0 -ts_max_time 200")
        assert s["regime"] == "stick-slip" and s["period"] > 1, (n, s["regime"], s["period"])


@pytest.mark.parametrize("law", ["dahl -friction_sigma0 5", "lugre -friction_sigma0 3", "table -friction_table -2:-0.3,0:1,1:0.7"])
def test_backwards_is_the_mirror_image(law):
    """Also where the state has a sign, and the law differs from one direction to the other."""
    def motion(side):
        turned = " ".join("-friction_table -1:-0.7,0:1,2:0.3" if word == "-friction_table -2:-0.3,0:1,1:0.7" and side < 0 else word
                          for word in law.partition("-friction_table -2:-0.3,0:1,1:0.7"))
        return run(f"-model_form chain -grid_n 1 -bc_left free -friction_law {turned} -model_v {0.5 * side} -init_psi {0.1 * side} "
                   f"-init_eta {0.1 * side} -ts_max_time 60")[0]
    there, back = motion(1), motion(-1)
    for key in ("amplitude", "regime", "regime_rate", "period", "rest_fraction", "time_to_decide"):
        assert there[key] == back[key], key
    assert there["psi_low"] == -back["psi_high"] and there["psi_high"] == -back["psi_low"]


def test_an_oscillation_that_never_rests():
    """It swings through psi = 0 both ways, and its force never holds it there."""
    scene = f"{SLIDER} -model_k0 1 -model_zeta 0.005 -model_v 6 -ts_max_time 100 -out_file r.h5 -out_checkpoint_every 300"
    found, _ = run(scene)
    said = call(f"{scene} -progress auto").stderr
    assert found["regime"] == "stick-slip" and found["psi_low"] < 0 and found["rest_fraction"] == 0
    assert "though nothing rests" in said


@pytest.mark.parametrize("law", ["", "-friction_stick regularised -friction_eps 1e-2"])
def test_rest_fraction_through_a_checkpoint(law):
    scene = f"{SLIDER} -model_v 0.5 -model_zeta 0.1 -ts_max_time 60 -out_file whole.h5 {law}"
    whole, _ = run(f"{scene} -out_checkpoint_every 50 -out_checkpoint_keep 9")
    checkpoints = sorted(glob.glob("whole.chk-*.h5"))
    for checkpoint in (checkpoints[0], checkpoints[-2]):
        again, _ = run(f"-restart {checkpoint} -out_file again.h5")
        assert again["rest_fraction"] == whole["rest_fraction"] > 0.1, checkpoint


def test_extremes_of_the_last_quarter_are_of_that_quarter():
    """Few long steps: what psi was before the quarter began is not taken for its extreme, by more than psi changes within two windows."""
    r = np.random.default_rng(1)
    for _ in range(14):
        out, _ = run(f"-model_form chain -grid_n 1 -bc_left free -friction_law {r.choice(['cubic', 'tanh'])} -model_m {r.uniform(.1, 2):.3f} -model_k0 {r.uniform(.1, 1):.3f} "
            f"-model_f0 {r.uniform(.3, 2):.3f} -model_zeta {r.uniform(0, .5):.3f} -model_v {r.uniform(.3, 1.5):.3f} "
            f"-init_psi {r.uniform(.3, 2):.3f} -init_eta {r.uniform(0, 1):.3f} -ts_max_time {r.uniform(4, 14):.3f} -ts_rtol 1e-4 -ts_atol 1e-4 "
            "-out_file a.h5 -out_frames 1281")
        high = out["psi_high"]
        psi = data("a.h5")["psi"][:, 0]
        within = np.abs(psi[40:] - psi[:-40]).max()
        assert abs(high - psi[960:].max()) <= within, f"{high} for {psi[960:].max()}, which changes by {within} within two windows"

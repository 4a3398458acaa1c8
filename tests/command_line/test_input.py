"""Wrong use, from the command line: each case must end with its exit code before any work, with one line on standard
error that names what is wrong, with nothing on standard output, and with every file in its folder as it was."""
import os
import re
import resource
import shutil
import subprocess
import tempfile

import h5py
import pytest

from calls import PROGRAM, SANITIZED, ran
from calls import run as command

SHORT = ["-grid_n", "32", "-ts_max_time", "0.1", "-progress", "off"]  # what makes a run short where it does run

# Scenes: name and bytes.
SCENES = {
    "good.yaml": b"model: {gamma: 2}\ngrid_n: 32\nts_max_time: 0.1\n",
    "good.opts": b"# plain form\n-model_gamma 2\n-grid_n 32\n-ts_max_time 0.1\n",
    "petscrc": b"# of PETSc\n\n-model_gamma 2\n",
    "empty.yaml": b"",
    "comments.yaml": b"# nothing\n\n",
    "nul.yaml": b"\0\0\0\0",
    "binary.yaml": b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08",
    "late_nul.yaml": b"model_gamma: 3\n\0grid_n: 5\n",
    "latin.yaml": b"model_gamma: 3 # \xe9t\xe9\n",
    "two.yaml": b"model_gamma: 3\n---\nmodel_gamma: 4\n",
    "twice.yaml": b"model_gamma: 3\ngrid_n: 64\nmodel_gamma: 4\n",
    "twice_nested.yaml": b"model: {gamma: 3}\nmodel_gamma: 4\n",
    "twice_case.yaml": b"model_gamma: 3\nMODEL_GAMMA: 4\n",
    "twice_map.yaml": b"model: {gamma: 3}\nmodel: {c: 4}\n",
    "tab.yaml": b"model:\n\tgamma: 3\n",
    "open.yaml": b"model: {gamma: 3\n",
    "anchor.yaml": b"model_gamma: &g 3\n",
    "tag.yaml": b"model_gamma: !!float 3\n",
    "text.yaml": b"this is not a scene\n",
    "json.yaml": b"[1, 2, 3]\n",
    "unknown.yaml": b"model:\n  gamma: 3\n  gama: 3\n",
    "typed.yaml": b"model:\n  gamma: three\n",
    "null.yaml": b"model:\n  gamma:\n",
    "hollow.yaml": b"grid_n: 64\nmodel:\n  # gamma: 3\n",
    "nest.yaml": b"options_file: good.yaml\n",
    "line.yaml": b"model: v: 0.5\n",
    "mixture.yaml": b"bc: {left: periodic, right: free}\n",
    "library.yaml": b"ts: {rtol: tight}\n",
    "dash.yaml": b"-model_gamma: 3\n",
    "spelt.yaml": b"friction: {law: cubik}\n",
}

# (arguments, exit code, what the line must contain)
USAGE = [
    ([], 2, "no command"),
    (["rum"], 2, "unknown command rum; did you mean run?"),
    (["xyzzy"], 2, "unknown command xyzzy"),
    (["good.yaml", "run"], 2, "no command before the scene: stickslip run good.yaml"),
    (["-model_gamma", "3", "run"], 2, "where the command should stand"),
    (["--version", "now"], 2, "now"),
    (["run", "good.yaml", "word"], 2, "stray word word"),
    (["run", "3"], 2, "stray word 3"),
    (["run", "-model_gamma", "3", "4"], 2, "stray word 4"),
    (["run", "good.yaml", "good.opts"], 2, "two scenes"),
    (["run", "good.txt"], 2, "stray word good.txt"),
]
OPTIONS = [
    (["-model_gama", "3"], "unknown option -model_gama; did you mean -model_gamma?"),
    (["-gamma", "3"], "did you mean -model_gamma?"),
    (["-xyzzy"], "unknown option -xyzzy"),
    (["-spectrum_transient"], "-spectrum_transient: this option is gone; a run from the perturbation shows"),
    (["-Spectrum_Pseudo", "60"], "this option is gone; "),
    (["-model_gamma=3"], "write the value as a word of its own: -model_gamma 3"),
    (["-ts_max_tim", "3"], "did you mean -ts_max_time?"),
    (["-ts_max_step", "3"], "did you mean -ts_max_steps?"),
    (["-ts_rtoll", "1e-3"], "did you mean -ts_rtol?"),
    (["-log_veiw"], "did you mean -log_view?"),
    (["-ts_veiw"], "did you mean -ts_view?"),
    (["-snes_no_such", "3", "-ts_type", "arkimex"], "unknown option -snes_no_such"),
    (["-ts_rk_type", "4", "-ts_type", "arkimex"], "-ts_rk_type 4: nothing reads it"),
    (["-ts_no_such_view"], "unknown option -ts_no_such_view"),
    (["-vec_no_such_thing", "1"], "unknown option -vec_no_such_thing"),
    (["-check", "-sub_pc_tpye", "lu"], "did you mean -sub_pc_type?"),
    (["-options_left", "maybe"], "-options_left maybe: must be true or false"),
    (["-snes_fd", "maybe", "-ts_type", "arkimex"], "-snes_fd maybe: "),
    (["-malloc_debug", "maybe"], "-malloc_debug maybe: "),
    (["-model_gamma"], "-model_gamma: needs a value"),
    (["-model_gamma", "-model_c", "2"], "-model_gamma: needs a value"),
    (["-model_gamma", "three"], "-model_gamma three: must be a finite number > 0"),
    (["-model_gamma", "nan"], "-model_gamma nan"),
    (["-model_gamma", "inf"], "-model_gamma inf"),
    (["-model_v", "-inf"], "-model_v -inf"),
    (["-model_v", "-Infinity"], "-model_v -Infinity"),
    (["-model_v", "1e999"], "-model_v 1e999"),
    (["-model_gamma", "0"], "-model_gamma 0"),
    (["-model_gamma", "-3"], "-model_gamma -3"),
    (["-model_gamma", "3x"], "-model_gamma 3x"),
    (["-model_gamma", "0x10"], "-model_gamma 0x10"),
    (["-model_gamma", "3,4"], "-model_gamma 3,4"),
    (["-model_gamma", ""], "-model_gamma ''"),
    (["-model_gamma", "3\nstickslip: all is well"], "-model_gamma 3?stickslip"),
    (["-model_c", "-1"], "-model_c -1"),
    (["-model_c", "1e200"], "overflow"),
    (["-model_delta", "nan"], "-model_delta nan"),
    (["-model_delta_sign", "print"], "did you mean printed?"),
    (["-model_form", "chains"], "did you mean chain?"),
    (["-model_gamma", "0"], "-model_gamma 0: must be a finite number > 0 (continuum: friction amplitude gamma"),
    (["-model_form", "chain", "-model_m", "-1"], "-model_m -1: must be a finite number >= 0"),
    (["-grid_n", "0"], "-grid_n 0: must be an integer from 1 to"),
    (["-grid_n", "-5"], "-grid_n -5"),
    (["-grid_n", "1"], "order 4 needs at least 5 nodes"),
    (["-grid_n", "2"], "order 4 needs at least 5 nodes"),
    (["-grid_n", "5", "-grid_order", "8"], "order 8 needs at least 9 nodes"),
    (["-grid_n", "10000000000"], "-grid_n 10000000000"),
    (["-grid_n", "1e10"], "-grid_n 1e10"),
    (["-grid_n", "4294967328"], "-grid_n 4294967328"),  # 32 if it wrapped
    (["-grid_n", "700000000"], "GB of memory"),
    (["-grid_n", "32.5"], "-grid_n 32.5"),
    (["-grid_n", "1,2"], "-grid_n 1,2"),
    (["-grid_order", "3"], "-grid_order 3: must be one of"),
    (["-grid_length", "-60"], "-grid_length -60"),
    (["-grid_length", "0"], "-grid_length 0"),
    (["-bc_left", "periodic", "-bc_right", "free"], "periodic holds at both ends or at neither"),
    (["-bc_left", "velocity", "-bc_right", "periodic"], "periodic holds at both ends or at neither"),
    (["-bc_left", "fixed"], "-bc_left fixed"),
    (["-bc_left_value", "-1.5"], "-bc_left_value -1.5: it needs -bc_left velocity"),
    (["-bc_left", "velocity", "-grid_order", "8"], "growing modes"),
    (["-model_form", "chain", "-model_delta", "0.2"], "-model_delta 0.2: a parameter of the continuum"),
    (["-model_form", "chain", "-model_gamma", "3"], "-model_gamma 3: a parameter of the continuum"),
    (["-model_zeta", "paper"], "-model_zeta paper: a parameter of the chain"),
    (["-model_form", "chain", "-grid_order", "4"], "-grid_order 4"),
    (["-model_form", "chain", "-grid_n", "1", "-bc_left", "velocity"], "at least 2 blocks"),
    (["-friction_law", "coulomb", "-friction_a", "0.1"], "-friction_a 0.1: a parameter of another law"),
    (["-friction_fs", "1"], "-friction_fs 1: a parameter of another law"),
    (["-friction_spread", "-0.1"], "-friction_spread -0.1"),
    (["-friction_spread", "2"], "at most 1"),
    (["-friction_back_slip", "maybe"], "true or false"),
    (["-friction_seed", "10000000000"], "-friction_seed 10000000000"),
    (["-state_law", "healing"], "phi(0) = 0"),
    (["-state_law", "ageing"], "belongs to rate-and-state or n-shaped"),
    (["-init_type", "sin"], "did you mean sine?"),
    (["-init_psi", "stedy"], "did you mean steady?"),
    (["-init_mode", "1.5"], "-init_mode 1.5"),
    (["-init_width", "0", "-init_type", "layer"], "-init_width 0"),
    (["-ts_max_time", "soon"], "-ts_max_time soon"),
    (["-ts_max_time", "-1"], "-ts_max_time -1"),
    (["-ts_max_steps", "1e16"], "-ts_max_steps 1e16"),
    (["-init_seed", "10000000000"], "-init_seed 10000000000"),
    (["-ts_rtol", "tight"], "-ts_rtol tight"),
    (["-ts_rtol", "nan"], "-ts_rtol nan"),
    (["-ts_rtol", "1e-30", "-ts_atol", "1e-30"], "ts_rtol 1e-30 with ts_atol 1e-30: below round-off"),
    (["-ts_dt", "0"], "-ts_dt 0"),
    (["-ts_type", "arkimix"], "-ts_type arkimix: no such method; did you mean arkimex?"),
    (["-ts_type", "unknownmethod"], "-ts_type unknownmethod"),
    (["-ts_rk_type", "5dq"], "did you mean 5dp?"),
    (["-ts_adapt_type", "basik"], "did you mean basic?"),
    (["-ts_adapt_clip", "1"], "-ts_adapt_clip 1"),
    (["-ts_type", "arkimex", "-ksp_gmres_restart", "1e10"], "-ksp_gmres_restart 1e10"),
    (["-ts_type", "arkimex", "-pc_type", "luu"], "did you mean lu?"),
    (["-ts_time_span", "0,1"], "-ts_time_span"),
    (["-options_file_yaml", "good.yaml"], "-options_file FILE reads a scene file"),
    (["-options_file", "missing.yaml"], "scene missing.yaml: No such file"),
    (["-ts_view", "asci:x"], "did you mean ascii?"),
    (["-ts_view", ":/nonexistent/x"], "/nonexistent"),
    (["-log_view", ":/nonexistent/x"], "/nonexistent"),
    (["-log_trace", "/nonexistent/x"], "/nonexistent"),
    (["-fp_trap", "perhaps"], "-fp_trap: not here"),
    (["-accuracy", "0"], "-accuracy 0"),
    (["-out_every", "0"], "-out_every 0"),
    (["-out_every", "1", "-out_frames", "5"], "give only one of them"),
    (["-out_frames", "1"], "-out_frames 1"),
    (["-out_times", "1,,2"], "-out_times 1,,2"),
    (["-out_times", "1,nan"], "-out_times 1,nan"),
    (["-out_probes", "x"], "-out_probes x"),
    (["-out_probes", "61"], "61"),
    (["-out_checkpoint_every", "0"], "-out_checkpoint_every 0"),
    (["-out_checkpoint_every", "10x", "-out_file", "new.h5"], "-out_checkpoint_every 10x"),
    (["-out_file", "/nonexistent/a.h5"], "/nonexistent"),
    (["-out_file", "."], "out_file"),
    (["-out_file", "notes.txt"], "notes.txt"),
    (["-out_file", "good.yaml"], "good.yaml"),
    (["-out_file", "foreign.h5"], "foreign.h5"),
    (["-out_file", ""], "-out_file ''"),
    (["-summary", "/nonexistent/a.json"], "/nonexistent"),
    (["-summary", "notes.txt"], "notes.txt"),
    (["-init_type", "file", "-init_file", "missing.h5"], "missing.h5"),
    (["-init_type", "file", "-init_file", "notes.txt"], "notes.txt"),
    (["-init_type", "file"], "init_file"),
    (["-restart", "missing.h5"], "missing.h5"),
    (["-restart", "notes.txt"], "notes.txt"),
]
SCENE_CASES = [
    ("missing.yaml", "scene missing.yaml: No such file"),
    ("folder.yaml", "scene folder.yaml: is a directory"),
    ("empty.yaml", "empty.yaml:1: no options"),
    ("comments.yaml", "comments.yaml:3: no options"),
    ("nul.yaml", "nul.yaml:1: not a text file"),
    ("binary.yaml", "binary.yaml:1: not a text file"),
    ("late_nul.yaml", "late_nul.yaml:2: not a text file"),
    ("latin.yaml", "latin.yaml:1: not a text file"),
    ("two.yaml", "two.yaml:2: several documents"),
    ("twice.yaml", "twice.yaml:3: key model_gamma stands here again, first in line 1"),
    ("twice_nested.yaml", "twice_nested.yaml:2: option model_gamma stands here again, first in line 1"),
    ("twice_case.yaml", "twice_case.yaml:2: key MODEL_GAMMA"),
    ("twice_map.yaml", "twice_map.yaml:2: key model"),
    ("tab.yaml", "tab.yaml:2: a tab"),
    ("open.yaml", "open.yaml:1: a brace, bracket or quote is not closed"),
    ("anchor.yaml", "anchor.yaml:1: anchors"),
    ("tag.yaml", "tag.yaml:1: tags"),
    ("text.yaml", "text.yaml:1:"),
    ("json.yaml", "json.yaml:1:"),
    ("good.opts", "a scene is YAML: write `name: value` where `-name value` stands"),
    ("unknown.yaml", "unknown option -model_gama (unknown.yaml:3); did you mean -model_gamma?"),
    ("typed.yaml", "-model_gamma three (typed.yaml:2): must be a finite number > 0"),
    ("null.yaml", "null.yaml:2: model_gamma needs a value"),
    ("hollow.yaml", "hollow.yaml:2: nothing stands under model"),
    ("nest.yaml", "nest.yaml:1: options_file has no place in a scene"),
    ("mixture.yaml", "periodic holds at both ends or at neither"),
    ("library.yaml", "-ts_rtol tight (library.yaml:1)"),
    ("dash.yaml", "dash.yaml:1: write the name without its dash"),
    ("spelt.yaml", "-friction_law cubik (spelt.yaml:1): must be one of cubic"),
]
# Cases for the environment: PETSC_OPTIONS and what the line must contain.
ENVIRONMENT = [
    ("-model_gama 3", "unknown option -model_gama (PETSC_OPTIONS)"),
    ("-model_gamma 3 stray", "PETSC_OPTIONS: stray word stray"),
    ("-ts_rtol soon", "-ts_rtol soon (PETSC_OPTIONS)"),
    ("-out_file 'a", "PETSC_OPTIONS: a quote is not closed"),
]
# What others call it, and slips of those who come from elsewhere.
MEANINGS = [("mu_s", "friction_fs"), ("mu_k", "friction_fd"), ("friction_mu", "friction_fs or -friction_fd"), ("Dc", "friction_D"),
            ("k", "model_k0"), ("stiffness", "model_k0"), ("model_stiffness", "model_k0"), ("velocity", "model_v"),
            ("speed", "model_v"), ("damping", "model_zeta"), ("mass", "model_m"), ("o", "out_file"), ("t_end", "ts_max_time"),
            ("dt", "ts_dt"), ("friction_V0", "friction_psi0")]
# Other commands.
COMMANDS = [
    *((["run", f"-{name}", "1"], f"unknown option -{name}; did you mean -{own}?") for name, own in MEANINGS),
    (["run", "-friction_law", "rate-state"], "did you mean rate-and-state?"),
    (["run", "-bc_left", "fixed"], "did you mean velocity?"),
    (["run", "-model_v", "0,5"], "-model_v 0,5: a decimal point, not a comma: 0.5"),
    (["run", "-ts_final_time", "3"], "-ts_final_time: not here: the end time is ts_max_time"),
    (["run", "-ts_type", "rk:6dp"], "ts_rk_type 6dp: not among the methods offered; did you mean 5dp?"),
    (["run", "-out_file", "x.csv"], "out_file 'x.csv': HDF5 is written (x.h5)"),
    (["plot", "x.h5"], "no command plot: pictures are drawn by postprocess/plot.py FILE.h5"),
    (["run", "line.yaml"], "line.yaml:1: two names on one line; write model: {v: 0.5}"),
    (["spectrum", "-grid_n", "32", "-eps_nevv", "3"], "did you mean -eps_ncv?"),
    (["spectrum", "-grid_n", "32", "-eps_tol", "x"], "-eps_tol x"),
    (["spectrum", "-st_type", "sinvert"], "-st_type: not here: J - sigma is inverted by the program itself"),
    (["spectrum", "-eps_target", "0"], "spectrum_method krylov"),
    (["spectrum", "-eps_smallest_magnitude"], "the rightmost eigenvalues"),
    (["spectrum", "-eps_nev", "3"], "spectrum_count"),
    (["spectrum", "-eps_type", "gd"], "one of krylovschur, arnoldi, subspace"),
    (["run", "-out_every", "1e-6", "-ts_max_time", "1e9", "-out_file", "a.h5"], "more than out_limit, 20 GB"),
    (["run", "-out_frames", "2000000000", "-out_file", "a.h5"], "more than out_limit"),
    (["run", "-grid_n", "8", "-out_every", "1e-300", "-out_file", "a.h5"], "more frames than can be counted"),
    (["help", "foo"], "unknown command foo"),
    (["run", "-help", "foo"], "-help foo: no such group of options; there are model, friction, "),
    (["spectrum", "-grid_n", "32", "-spectrum_count", "0"], "-spectrum_count 0"),
    (["spectrum", "-grid_n", "32", "-spectrum_method", "kryloff"], "did you mean krylov?"),
    (["spectrum", "-grid_n", "32", "-out_file", "notes.txt"], "notes.txt"),
    (["spectrum", "-grid_n", "32", "-summary", "notes.txt"], "notes.txt"),
    (["spectrum", "-grid_n", "5", "-grid_order", "8"], "order 8 needs at least 9 nodes"),
    (["boundary", "-grid_n", "32"], "boundary_parameter"),
    (["boundary", "-grid_n", "32", "-boundary_parameter", "model_w", "-boundary_from", "0", "-boundary_to", "1"],
     "model_w"),
    (["boundary", "-grid_n", "32", "-boundary_parameter", "model_form", "-boundary_from", "0", "-boundary_to", "1"],
     "model_form"),
    (["boundary", "-grid_n", "32", "-boundary_parameter", "model_v", "-boundary_from", "0"], "boundary_to"),
    (["boundary", "-grid_n", "32", "-boundary_parameter", "model_v", "-boundary_from", "1", "-boundary_to", "2", "-eps_tool", "1"],
     "did you mean -eps_tol?"),
    (["sweep", "-grid_n", "32", "-sweep_parameter1", "model_v", "-sweep_values1", "1,2", "-dm_no_such_thing"],
     "unknown option -dm_no_such_thing"),
    (["sweep", "-grid_n", "32", "-out_file", "s.h5", "-sweep_parameter1", "ts_rtoll", "-sweep_values1", "1,2"], "did you mean ts_rtol?"),
    (["laws", "-friction_law", "cubix"], "did you mean cubic?"),
    (["laws", "-out_file", "notes.txt"], "notes.txt"),
    (["laws", "-log_veiw"], "did you mean -log_view?"),
    (["fit", "-grid_n", "16", "-fit_parameters", "model_v"], "-fit_data: give a file"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1"], "-fit_parameters: give the options"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1", "-fit_parameters", "model_v,model_gamma,model_delta"],
     "2 rows cannot tell 3 parameters"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,61:1", "-fit_parameters", "model_v"], "61 lies outside the run"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1", "-fit_parameters", "model_form"], "model_form: it is no number"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1", "-fit_parameters", "model_gama"], "did you mean model_gamma?"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1", "-fit_parameters", "model_v,model_v"], "stands there twice"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1", "-fit_parameters", "spectrum_count"], "it is no number that a run depends on"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:1,2:1", "-fit_parameters", "model_v,model_c"], "model_c: it has no effect"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,1:nan", "-fit_parameters", "model_v"], "fit_data"),
    (["fit", "-grid_n", "16", "-fit_data", "0:1,100:1", "-fit_parameters", "model_v", "-fit_against", "displacement"],
     "the load point does not come to 100"),
    (["wave"], "exactly one of the two"),
    (["wave", "-wave_length", "100", "-wave_speed", "3"], "give only one of them"),
    (["wave", "-wave_length", "-1"], "-wave_length -1"),
    (["wave", "-wave_speed", "0.5"], "|V| > model_c"),
    (["wave", "-wave_length", "100", "-model_form", "chain"], "continuum only"),
    (["wave", "-wave_length", "100", "-snes_foo", "3"], "unknown option -snes_foo"),
    (["wave", "-wave_length", "100", "-out_file", "notes.txt"], "notes.txt"),
]
# On two ranks: arguments and what the line must contain.
PARALLEL = [
    (["run", "binary.yaml"], "binary.yaml:1: not a text file"),
    (["run", "missing.yaml"], "scene missing.yaml: No such file"),
    (["run", "-model_gama", "3"], "did you mean -model_gamma?"),
    (["run", "-out_file", "notes.txt"] + SHORT, "notes.txt"),
    (["run", "-summary", "/nonexistent/a.json"] + SHORT, "/nonexistent"),
    (["run", "-ts_rtoll", "1"] + SHORT, "did you mean -ts_rtol?"),
    (["run", "-ts_adapt_clip", "1"] + SHORT, "-ts_adapt_clip 1"),
    ([], "no command"),
]


def make_folder(path):
    for name, text in SCENES.items():
        with open(os.path.join(path, name), "wb") as file:
            file.write(text)
    os.mkdir(os.path.join(path, "folder.yaml"))
    with open(os.path.join(path, "notes.txt"), "w") as file:
        file.write("mine, not the program's\n")
    with h5py.File(os.path.join(path, "foreign.h5"), "w") as file:
        file["x"] = [1.0, 2.0]


def contents(path):
    found = {}
    for folder, _, files in os.walk(path):
        for name in files:
            with open(os.path.join(folder, name), "rb") as file:
                found[os.path.join(folder, name)] = file.read()
    return found


def run(arguments, folder, environment=None, ranks=1):
    if ranks == 1 and not environment:
        done = ran([PROGRAM, *arguments], folder)
    else:
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        with tempfile.TemporaryDirectory() as own:  # two Open MPI programs at a time must not share a session folder
            done = ran(launcher + [PROGRAM, *arguments], folder, stdin=subprocess.DEVNULL,
                       env={**os.environ, "OMPI_MCA_orte_tmpdir_base": own, **(environment or {})})
    return done.returncode, done.stdout, done.stderr


CASES = [(arguments, code, expected, None, 1) for arguments, code, expected in USAGE]
CASES += [(["run"] + SHORT + arguments, 2, expected, None, 1) for arguments, expected in OPTIONS]
CASES += [(["run", scene], 2, expected, None, 1) for scene, expected in SCENE_CASES]
CASES += [(["run"] + SHORT, 2, expected, {"PETSC_OPTIONS": text}, 1) for text, expected in ENVIRONMENT]
CASES += [(["run"] + SHORT, 2, "PETSC_OPTIONS_YAML: is not read; give -options_file", {"PETSC_OPTIONS_YAML": "model: {gamma: 7}"}, 1)]
CASES += [(["run", "-options_file", "petscrc"] + SHORT, 2, "give the words of this file in PETSC_OPTIONS", None, 1)]
CASES += [(arguments, 2, expected, None, 1) for arguments, expected in COMMANDS]
CASES += [(arguments, 2, expected, None, 2) for arguments, expected in PARALLEL]


@pytest.mark.parametrize("arguments, code, expected, environment, ranks", CASES,
                         ids=[re.sub(r"[^ -~]", "?", " ".join(case[0])[:60]) or "nothing" for case in CASES])
def test_wrong_use(arguments, code, expected, environment, ranks):
    """Each case has a folder of its own, so that harm is seen where it is done."""
    make_folder(".")
    before = contents(".")
    got, out, err = run(arguments, ".", environment, ranks)
    lines = err.splitlines()
    if ranks > 1:  # mpirun adds lines of its own
        lines = [line for line in lines if line.startswith("stickslip:") or "PETSC ERROR" in line]
    assert got == code, err
    assert len(lines) == 1 and lines[0].startswith("stickslip: error: ") and expected in lines[0], err
    assert len(lines[0]) <= 500
    assert out == ""
    assert contents(".") == before


def test_right_use(scratch):
    """What must work: help, version, the order of precedence, the scene anywhere, negative values."""
    folder = str(scratch)
    make_folder(folder)
    trouble = []

    def expect(arguments, told, environment=None, code=0, silent=True):
        got, out, err = run(arguments, folder, environment)
        if got != code or told not in out or (silent and err):
            trouble.append(f"{arguments}: exit {got}, out {out[:200]!r}, err {err[:300]!r}, expected {told!r}")
        return out

    expect(["--help"], "commands:\n  run")
    expect(["-help"], "usage: stickslip COMMAND")
    expect(["run", "-help"], "-model_gamma [3]: a finite number > 0")
    expect(["run", "--help", "-no_such_option"], "-grid_order [4")
    group = expect(["run", "-help", "grid"], "-grid_order [4")
    if "-model_v" in group:
        trouble.append("-help grid shows other groups")
    expect(["run", "-help", "Profiles"], "-friction_mu0_factor [1]")
    whole = expect(["run", "-help"], "-NAME_profile [none]")
    if "-friction_mu0_factor" in whole or whole.index("-profile_kind") < whole.index("-out_file"):
        trouble.append("-help shows every profile, or first what is rarely set")
    expect(["run", "-help", "all", "-ts_type", "bdf"], "-ts_bdf_order")
    for text in (expect(["--version"], "stickslip "), expect(["run", "-version"], "stickslip ")):
        for library in ("git ", "petsc release version 3", "slepc release version 3", "open mpi"):  # in words of their own
            if library not in text.lower():
                trouble.append(f"--version does not tell {library}")

    def gamma(arguments, expected, environment=None):
        expect(["run", "-summary", "-"] + SHORT + arguments, f'"model_gamma": "{expected}"', environment)

    with open(os.path.join(folder, "HOME.petscrc"), "w") as file:
        file.write("-model_gamma 9\n-ts_rtol oops\n")
    shutil.copy(os.path.join(folder, "HOME.petscrc"), os.path.join(folder, ".petscrc"))
    gamma([], "3")  # .petscrc is not read
    gamma(["good.yaml"], "2")
    gamma(["-model_c", "1", "good.yaml", "-model_v", "-0.2"], "2")
    gamma(["good.yaml", "-model_gamma", "5"], "5")
    gamma(["-model_gamma", "5", "good.yaml"], "5")
    gamma(["--model_gamma", "5"], "5")
    gamma(["-MODEL_gamma", "5"], "5")
    gamma(["-model_gamma", "4", "-model_gamma", "5"], "5")
    gamma(["good.yaml"], "4", {"PETSC_OPTIONS": "-model_gamma 4"})
    gamma(["good.yaml", "-model_gamma", "5"], "5", {"PETSC_OPTIONS": "-model_gamma 4"})
    gamma(["-options_file", "good.yaml"], "2")
    gamma(["-options_file", "good.yaml", "-model_gamma", "5"], "5")
    shutil.copy(os.path.join(folder, "good.yaml"), os.path.join(folder, "without_suffix"))
    gamma(["-options_file", "without_suffix"], "2")
    gamma(["-out_displacement", "good.yaml"], "2")  # a flag does not swallow the scene
    expect(["run", "-summary", "-", "-bc_left", "velocity", "-bc_left_value", "-1.5"] + SHORT,
           '"bc_left_value": "-1.5"', silent=False)
    expect(["run", "-eps_ncv", "30"] + SHORT, "", silent=False)
    _, _, err = run(["run", "-eps_ncv", "30"] + SHORT, folder)
    if err != "stickslip: warning: -eps_ncv 30 was not used\n":
        trouble.append(f"-eps_ncv 30 for run: {err!r}")
    for words in ("-ts_alpha_radius 0.5", "-eps_arnoldi_delayed true", "-st_filter_degree 3", "-ksp_richardson_scale 1",
                  "-snes_qn_m 3", "-pc_gamg_threshold 0.1", "-mg_levels_1_ksp_type cg", "-ksp_richardson_scale 1 -ts_type bdf"):
        _, _, err = run(["run", "-check", *words.split()] + SHORT, folder)  # known, but of an object that is not made
        told = [line for line in err.splitlines() if "warning" in line]
        if len(told) != 1 or words.split()[0] not in told[0]:
            trouble.append(f"{words}: {err!r}")
    expect(["help"], "commands:\n  run")
    expect(["help", "wave"], "-wave_pulses [1]")
    expect(["run", "-options_view"] + SHORT, "#Own options:\n-grid_n 32\n")
    expect(["run", "-options_left", "-wave_pulses", "3"] + SHORT, "#Own options that run does not read:\n-wave_pulses 3\n")
    expect(["run", "-ts_view"] + SHORT, "TS Object")
    expect(["run", "-log_view"] + SHORT, "Performance Summary")
    assert not trouble, "\n".join(trouble)


@pytest.mark.skipif(SANITIZED, reason="the sanitizers need all addresses")
@pytest.mark.parametrize("arguments, refused", [
    ("run -grid_n 20000000 -init_type sine", r"needs at least \S+ GB of memory \(\S+ bytes a node\)"),
    # known only with the method: chosen (stiff friction and waves), named, and that of a restart's options
    ("run -grid_n 1500000 -init_type sine", r"bytes a node, (arkimex|rosw):"),
    ("run -grid_n 600000 -init_type sine -ts_type bdf", r"needs 0.\d+ GB of memory \(\d+ bytes a node, bdf"),
    ("run -grid_n 600000 -init_type sine -ts_type bdf -check", r"bytes a node, bdf"),
    ("run -grid_n 600000 -init_type uniform -ts_type bdf -check", ""),  # one node for all
    ("spectrum -grid_n 2000000", "needs at least 3.06 GB of memory"), ("boundary -boundary_of sliding -grid_n 4000000", "GB of memory"),
    ("chart -grid_n 4000000 -init_type sine", "GB of memory"), ("run -grid_n 100000 -init_type sine -ts_max_steps 2", "")])
def test_memory_that_is_not_there(scratch, arguments, refused):
    """What a command takes is held against `ulimit -v` before it begins, with its method where the options leave that open."""
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (600_000_000, 600_000_000))
    words = [PROGRAM, *arguments.split(), "-out_file", "o.h5", "-progress", "off"]
    done = subprocess.run(words, cwd=scratch, preexec_fn=limit, capture_output=True, text=True, check=False)
    lines = done.stderr.splitlines()
    if refused:
        assert done.returncode == 2 and len(lines) == 1 and re.search(refused, lines[0]), done.stderr
        assert re.search(r"ulimit -v leaves 0.\d+ GB$", lines[0]) and not os.path.exists(os.path.join(scratch, "o.h5"))
    else:
        assert done.returncode == 0, done.stderr


def test_other_ways_to_write_the_same():
    """The first of several parameters with its number or without; a method in the notation of charts and closing lines."""
    found = [command(words + " -model_delta 0.2 -boundary_from 0.5 -boundary_to 2", command="boundary")[0]["points"][0]["value"]
             for words in ("-boundary_parameter model_v", "-boundary_parameter1 model_v")]
    assert found[0] == found[1], found
    rows = [command(f"-sweep_parameter{k} model_v -sweep_values{k} 0.5,1 -ts_max_time 1 -grid_n 8 -out_file s{k}.h5",
                    command="sweep")[0] for k in ("", "1")]
    assert rows[0]["done"] == rows[1]["done"] == 2, rows
    for method, apart in (("rk:5dp", "-ts_type rk -ts_rk_type 5dp"), ("bdf:2", "-ts_type bdf -ts_bdf_order 2"),
                          ("arkimex:4:friction", "-ts_type arkimex -ts_arkimex_type 4 -imex_implicit friction")):
        made = [command(f"-grid_n 8 -ts_max_time 1 {words}")[0] for words in (f"-ts_type {method}", apart)]
        assert made[0]["psi_max"] == made[1]["psi_max"] and made[0]["options"] == made[1]["options"], method

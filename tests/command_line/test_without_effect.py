"""Options that change nothing beside the others are told, in one line; what would replace a part of a file to start from is
refused in a scene and told on the command line."""
import pytest

from calls import PROGRAM, ran

SHORT = "-progress off -ts_max_time 0.1 -grid_n 40 -grid_length 4 "
CHAIN = "-progress off -ts_max_time 0.1 -model_form chain "


def call(line, folder):
    return ran([PROGRAM, *line.split()], folder)


def told(line, folder):
    done = call(line, folder)
    assert done.returncode == 0, done.stderr
    lines = [one for one in done.stderr.splitlines() if "without effect here: " in one]
    assert len(lines) <= 1
    return lines[0].split("without effect here: ")[1] if lines else ""


@pytest.mark.parametrize("line, without_effect", [
    ("run " + SHORT + "-friction_stick exact", "-friction_stick (friction_law is cubic, which has no threshold)"),
    ("run " + SHORT + "-friction_seed 3", "-friction_seed (friction_spread is 0)"),
    ("run " + SHORT + "-friction_seed 3 -friction_spread 0.1", ""),
    ("run " + SHORT + "-init_type sine -init_width 3", "-init_width (init_type is sine)"),
    ("run " + SHORT + "-out_events_velocity 1", "-out_events_velocity (out_events is false)"),
    ("run " + SHORT + "-out_events yes -out_events_velocity 1", ""),
    ("run " + SHORT + "-ts_type rk -snes_rtol 1e-9 -pc_type lu",
     "-pc_type (rk:5dp solves no equations), -snes_rtol (rk:5dp solves no equations)"),
    ("run " + CHAIN + "-grid_n 1 -model_k1 3", "-model_k1 (grid_n is 1, and one block has no neighbour)"),
    ("run " + CHAIN + "-grid_n 1 -model_k1 3 -model_zeta paper", ""),
    ("cycle -progress off -friction_seed 3", "-friction_seed (friction_spread is 0)"),
    ("boundary -progress off -model_form chain -grid_n 1 -model_k1 0.1 -boundary_parameter model_v -boundary_from 0.5 "
     "-boundary_to 2 -boundary_of sliding", "-model_k1 (grid_n is 1, and one block has no neighbour)"),
])
def test_told(line, without_effect, tmp_path):
    assert told(line, tmp_path) == without_effect


def test_nothing_is_said_of_what_hangs_on_a_varied_option(tmp_path):
    line = ("boundary -progress off -grid_n 20 -friction_seed 3 -boundary_parameter model_v -boundary_from 0.5 -boundary_to 2 "
            "-boundary_of sliding ")
    assert "friction_seed" in told(line, tmp_path)
    assert told(line + "-boundary_parameter2 friction_spread -boundary_from2 0 -boundary_to2 0.1 -boundary_points 3",
                tmp_path) == ""


def test_what_a_file_to_start_from_holds(tmp_path):
    assert call("run -out_file a.h5 " + SHORT, tmp_path).returncode == 0
    (tmp_path / "scene.yaml").write_text("init:\n  type: file\n  file: a.h5\n  eta: 0.3\n", encoding="utf-8")
    done = call("run scene.yaml " + SHORT, tmp_path)
    assert done.returncode == 2 and "it holds eta, and so does scene.yaml:4: init_eta 0.3" in done.stderr
    done = call("run -init_type file -init_file a.h5 -init_eta 0.3 " + SHORT, tmp_path)
    assert done.returncode == 0 and "-init_eta 0.3 replaces the eta that it holds" in done.stderr


@pytest.mark.parametrize("kind", ["aij", "baij"])
def test_everyday_names_of_matrices(kind, tmp_path):
    line = "run -ts_type cn -grid_n 20 -grid_length 2 -ts_max_time 0.01 -progress off -dm_mat_type " + kind
    assert call(line, tmp_path).returncode == 0

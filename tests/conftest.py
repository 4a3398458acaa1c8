"""Fixtures of all tests written in Python: a folder of one's own, an environment for Open MPI, seeded scenes."""
import os

import numpy as np
import pytest

if int(np.__version__.split(".")[0]) > 1:  # in a command line a number is 0.1, not np.float64(0.1)
    np.set_printoptions(legacy="1.25")


def pytest_addoption(parser):
    parser.addoption("--scenes", type=int, help="random scenes of each audit (else what it says itself, 20 or fewer)")
    parser.addoption("--seed", type=int, default=2026, help="their seed")


def pytest_collection_modifyitems(items):
    """A test has the label of its folder."""
    for item in items:
        item.add_marker({"command_line": "command_line", "audit": "long"}[item.path.parent.name])


@pytest.fixture(autouse=True)
def scratch(tmp_path, monkeypatch):
    """Every test works in a folder of its own. Open MPI's folder stands there too: programs that end remove it."""
    (tmp_path / "mpi").mkdir()
    (tmp_path / "work").mkdir()
    monkeypatch.setenv("OMPI_MCA_orte_tmpdir_base", str(tmp_path / "mpi"))
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


@pytest.fixture
def scenes(request):
    """scenes(draw, salt) yields (index, draw(generator)) for each random scene; one generator a scene, so that a scene
    can be drawn again by its index alone whatever came before. `short` is how many there are unless --scenes says."""
    count, seed = request.config.getoption("--scenes"), request.config.getoption("--seed")

    def drawn(draw, salt, short=20):
        for index in range(count or short):
            yield index, draw(np.random.default_rng([seed, salt, index]))
    return drawn

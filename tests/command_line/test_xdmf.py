"""postprocess/xdmf.py: what it writes names every frame of a run (ParaView itself reads it in tests/in_paraview.py)."""
import os
import xml.etree.ElementTree as xml

import h5py

from calls import SOURCE, run, tool

SCRIPT = os.path.join(SOURCE, "postprocess", "xdmf.py")


def test_every_frame_is_named():
    run("-grid_n 32 -init_type sine -ts_max_time 1 -out_frames 4 -state_law ageing -friction_law rate-and-state -out_file a.h5")
    done = tool("xdmf.py", "a.h5")
    assert done.returncode == 0 and done.stdout == "a.xdmf\n", done.stderr
    grids = xml.parse("a.xdmf").getroot().findall("Domain/Grid/Grid")
    with h5py.File("a.h5") as file:
        assert [float(grid.find("Time").get("Value")) for grid in grids] == list(file["t"][()])
        for frame, grid in enumerate(grids):
            assert {a.get("Name") for a in grid.findall("Attribute")} == {"psi", "eta", "theta"}
            for attribute in grid.findall("Attribute"):
                slab, source = attribute.find("DataItem")
                assert slab.text.split() == [str(frame), "0", "1", "1", "1", "32"]
                assert source.text == "a.h5:/" + attribute.get("Name") and source.get("Dimensions") == "4 32"


def test_a_file_of_another_kind_is_refused():
    with open("notes.txt", "w", encoding="utf-8") as file:
        file.write("no")
    done = tool("xdmf.py", "notes.txt")
    assert done.returncode == 2 and done.stderr.startswith("xdmf.py: error: 'notes.txt' ") and done.stderr.count("\n") == 1

"""ParaView reads what postprocess/xdmf.py writes: every frame and field of a run, to the last bit.

    build/stickslip run runs/ring.yaml -ts_max_time 5 -out_file ring.h5 && postprocess/xdmf.py ring.h5
    pvpython --force-offscreen-rendering tests/in_paraview.py ring.xdmf ring.h5       (Debian: paraview, python3-paraview)
"""
import sys

import h5py
import numpy as np
from paraview import servermanager, simple
from vtkmodules.util.numpy_support import vtk_to_numpy

described, fields = sys.argv[1:3]
reader = simple.XDMFReader(FileNames=[described])
reader.UpdatePipelineInformation()
with h5py.File(fields) as file:
    assert np.array_equal(reader.TimestepValues, file["t"][()]), "the times of the frames"
    for frame, t in enumerate(reader.TimestepValues):
        reader.UpdatePipeline(t)
        grid = servermanager.Fetch(reader)
        assert np.array_equal(vtk_to_numpy(grid.GetXCoordinates()), file["x"][()]), "the nodes"
        for name in ("psi", "eta"):
            assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray(name)), file[name][frame]), f"{name} at {t}"
    print(f"{len(file['t'])} frames: equal")

#!/usr/bin/python3
"""Writes beside the file of a run an XDMF file with which ParaView opens its frames as a time series on the grid.

    xdmf.py RUN.h5 [-o RUN.xdmf]

The fields stay in the HDF5 file, which the XDMF file names relative to itself. In ParaView: "XDMF Reader", then "Plot Over
Line" (or the filter "Plot Data") for a frame.
"""
import argparse
import os
import sys
from xml.sax.saxutils import quoteattr

from stickslip import Unusable, reading


def document(source, name):
    """The text, for a file whose name from there is `name`."""
    frames, nodes = source["psi"].shape
    fields = [field for field, data in source.items() if getattr(data, "shape", None) == (frames, nodes)]

    def item(path, dimensions):
        return f'<DataItem Format="HDF" NumberType="Float" Precision="8" Dimensions="{dimensions}">{name}:/{path}</DataItem>'
    grids = []
    for frame, t in enumerate(source["t"][()]):
        attributes = "".join(
            f'<Attribute Name={quoteattr(field)} Center="Node"><DataItem ItemType="HyperSlab" Dimensions="1 1 {nodes}">'
            f'<DataItem Dimensions="3 2" Format="XML">{frame} 0 1 1 1 {nodes}</DataItem>'
            f'{item(field, f"{frames} {nodes}")}</DataItem></Attribute>\n' for field in fields)
        grids.append(f'<Grid Name="frame {frame}"><Time Value="{float(t)!r}"/>'
                     f'<Topology TopologyType="3DRectMesh" Dimensions="1 1 {nodes}"/><Geometry GeometryType="VXVYVZ">'
                     f'{item("x", nodes)}<DataItem Dimensions="1">0</DataItem><DataItem Dimensions="1">0</DataItem>'
                     f'</Geometry>\n{attributes}</Grid>\n')
    return ('<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain><Grid Name="run" GridType="Collection" '
            'CollectionType="Temporal">\n' + "".join(grids) + "</Grid></Domain></Xdmf>\n")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("-o", "--out")
    given = parser.parse_args(arguments)
    out = given.out or os.path.splitext(given.file)[0] + ".xdmf"
    try:
        with reading(given.file) as source:
            if "psi" not in source or "t" not in source:
                raise Unusable("is not the file of a run")
            text = document(source, os.path.relpath(given.file, os.path.dirname(out) or "."))
    except Unusable as error:
        print(f"xdmf.py: error: '{given.file}' {error}", file=sys.stderr)
        return 2
    with open(out, "w", encoding="utf-8") as file:
        file.write(text)
    print(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())

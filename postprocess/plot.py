#!/usr/bin/python3
"""Draws result files of stickslip as PNG.

    plot.py FILE [FILE ...] [-o OUT.png] [--what WHAT] [--frame N]
    plot.py FILE --movie [-o OUT.gif]

The kind of the file decides what is drawn; for the file of a run, WHAT is one of
    xt         psi over x and t; --field names another field. Of one block, or a medium that moves as one: psi and eta
               against t, and the limit cycle
    profile    psi, eta (and the state) against x at one frame
    phase      eta against psi at one frame, with the nullclines and the fixed point of uniform sliding
    probes     psi and eta of the probes against time
    series     means, extremes, steps, ... against time
    catalogue  slip events (out_events); events.py fits them and compares several
    lab        as laboratories draw it: friction, velocity and state over the displacement of the load point; files of fit
               behind that of the run are drawn over it
    lyapunov   Lyapunov exponents (lyapunov_count): how each settles, and all of them with their errors
The default is the catalogue where there is one, else xt. Several runs, stability diagrams or spectra are drawn over
each other; runs as series, --profile or --phase. Of a sweep over two options: a map of regimes, over one: a diagram;
--key NAME draws a number of the summaries instead. Files of boundary behind it are drawn over it.
"""
import argparse
import contextlib
import os
import sys

os.environ.setdefault("MPLBACKEND", "Agg")

import matplotlib  # noqa: E402

matplotlib.use("Agg")

from figures_analysis import draw_laws, draw_spectrum, draw_wave, overlay_spectra  # noqa: E402
from figures_boundary import diagram, draw_boundary, overlay_boundaries  # noqa: E402
from figures_chart import draw_chart  # noqa: E402
from figures_cycle import draw_cycle  # noqa: E402
from figures_fit import draw_fit, draw_lab  # noqa: E402
from figures_run import RUN_PICTURES, draw_run, movie, overlay  # noqa: E402
from figures_sweep import draw_sweep  # noqa: E402
from stickslip import Unusable, reading, text  # noqa: E402

KINDS = {"run": draw_run, "laws": draw_laws, "spectrum": draw_spectrum, "wave": draw_wave, "cycle": draw_cycle,
         "boundary": draw_boundary, "chart": draw_chart, "sweep": draw_sweep, "fit": draw_fit}
TOGETHER = {"run": overlay, "boundary": overlay_boundaries, "spectrum": overlay_spectra}


def draw(files, args):
    """The figure for open files of one kind."""
    each = [text(file.attrs.get("kind", "")) for file in files]
    if args.key and each[0] != "sweep":
        raise Unusable(f"holds the result of {each[0]}: --key is for the file of a sweep")
    if each[0] == "sweep" and set(each[1:]) == {"boundary"}:
        return draw_sweep(files[0], args, files[1:])
    if args.what == "lab":
        if each[0] != "run" or set(each[1:]) - {"fit"}:
            raise Unusable("is one of several: --lab takes the file of a run, and behind it those of fits")
        return draw_lab(files[0], files[1:])
    kinds = set(each)
    if kinds == {"boundary", "wave"}:
        return diagram(files, args)
    kind = kinds.pop()
    if kind not in KINDS:
        raise Unusable(f"holds a {kind}, of which there is no picture")
    if kinds or (len(files) > 1 and kind not in TOGETHER):
        raise Unusable("is one of several: drawn together are files of run, of boundary or of spectrum, or a sweep and "
                       "then its boundaries")
    if (args.what or args.movie) and kind != "run":
        raise Unusable(f"holds the result of {kind}: --what and --movie are for the file of a run")
    return TOGETHER[kind](files, args) if len(files) > 1 else KINDS[kind](files[0], args)


def make(args, output):
    """Draws and writes."""
    with contextlib.ExitStack() as stack:
        files = []
        for path in args.files:
            args.file = path
            files.append(stack.enter_context(reading(path)))
        args.file = args.files[0]
        try:
            if args.movie and len(files) == 1 and text(files[0].attrs.get("kind", "")) == "run":
                return movie(files[0], args, output)
            figure = draw(files, args)
        except (KeyError, OSError, RuntimeError) as error:
            raise Unusable(f"is damaged or incomplete: {str(error).splitlines()[0]}") from error
    return figure.savefig(output)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", metavar="FILE", nargs="+", help="HDF5 file that stickslip wrote")
    parser.add_argument("-o", "--output", metavar="OUT.png", help="default: FILE with .png (and -WHAT before it)")
    parser.add_argument("--what", choices=sorted([*RUN_PICTURES, "lab"]), help="picture of a run")
    for name in ("profile", "phase", "probes", "series", "catalogue", "lyapunov", "lab"):
        parser.add_argument("--" + name, dest="what", action="store_const", const=name, help=f"short for --what {name}")
    parser.add_argument("--movie", action="store_true", help="of a run, as GIF (-o OUT.mp4: MP4, by ffmpeg)")
    parser.add_argument("--field", metavar="NAME", help="xt: field to draw (psi)")
    parser.add_argument("--key", metavar="NAME", help="sweep: number of the summaries to draw")
    parser.add_argument("--frame", type=int, metavar="N", help="profile, phase: frame, from 0 (the last)")
    args = parser.parse_args(arguments)
    output = args.output
    if not output:
        output = os.path.splitext(args.files[0])[0] + (f"-{args.what}" if args.what not in (None, "xt") else "") + \
            (".gif" if args.movie else ".png")
    try:
        make(args, output)
    except Unusable as error:
        print(f"plot.py: error: '{args.file}' {error}", file=sys.stderr)
        return 2
    except (OSError, ValueError) as error:
        print(f"plot.py: error: cannot write '{output}': {error}", file=sys.stderr)
        return 2
    print(output)
    return 0


if __name__ == "__main__":
    sys.exit(main())

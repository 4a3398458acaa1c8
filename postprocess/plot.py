#!/usr/bin/python3
"""Draws result files of stickslip.

    plot.py FILE [FILE ...] [-o OUT.png] [--what WHAT] [--frame N]
    plot.py FILE -o figure.pdf --size 3.4x2.6 --style journal.mplstyle --label "model_v=Disc speed (m/s)"
    plot.py FILE --movie [-o OUT.gif]

OUT may end in .png, .pdf, .svg or whatever else matplotlib writes. A matplotlibrc holds, and a style sheet (--style) over it.

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
--key NAME draws a number of the summaries instead. Files of boundary behind it are drawn over it; over a diagram of one
option branches of cycle, too. A chart of limits shows the steps that are right, with --fails how longer ones fail.
Solid lines are stable and dashed ones unstable, wherever either may be.
"""
import argparse
import os
import sys

def size_of(text):
    """WIDTHxHEIGHT in inches."""
    width, height = map(float, text.lower().split("x"))
    if not (0.5 <= width <= 100 and 0.5 <= height <= 100):
        raise ValueError(text)
    return width, height


def label_of(text):
    name, words = text.split("=", 1)
    return name.strip(), words.strip()


PICTURES = ("xt", "profile", "phase", "probes", "series", "catalogue", "lyapunov", "lab")  # of a run


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", metavar="FILE", nargs="+", help="HDF5 file that stickslip wrote")
    parser.add_argument("-o", "--output", metavar="OUT.png", help="default: FILE with .png (and -WHAT before it)")
    parser.add_argument("--what", choices=sorted(PICTURES), help="picture of a run")
    for name in PICTURES[1:]:
        parser.add_argument("--" + name, dest="what", action="store_const", const=name, help=f"short for --what {name}")
    parser.add_argument("--movie", action="store_true", help="of a run, as GIF (-o OUT.mp4: MP4, by ffmpeg)")
    parser.add_argument("--field", metavar="NAME", help="xt: field to draw (psi)")
    parser.add_argument("--key", metavar="NAME", help="sweep: number of the summaries to draw")
    parser.add_argument("--fails", action="store_true", help="chart of limits: how methods fail, not the steps that are right")
    parser.add_argument("--style", metavar="FILE", help="style sheet of matplotlib (.mplstyle), or the name of one")
    parser.add_argument("--size", metavar="WxH", type=size_of, help="width and height in inches, e.g. 3.4x2.6")
    parser.add_argument("--label", metavar="NAME=WORDS", type=label_of, action="append", default=[],
                        help="what an option or a quantity is called, e.g. \"model_v=Disc speed (m/s)\"; may stand several times")
    parser.add_argument("--frame", type=int, metavar="N", help="profile, phase: frame, from 0 (the last)")
    args = parser.parse_args(arguments)
    from drawing import Unusable, make  # not before: matplotlib takes most of a second
    import style
    output = args.output
    if not output:
        output = os.path.splitext(args.files[0])[0] + (f"-{args.what}" if args.what not in (None, "xt") else "") + \
            (".gif" if args.movie else ".png")
    try:
        style.choose(args.style, args.size, args.label)
    except (OSError, ValueError) as error:
        print(f"plot.py: error: --style {args.style}: {str(error).splitlines()[0]}", file=sys.stderr)
        return 2
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

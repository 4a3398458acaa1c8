"""What plot.py draws: a figure for open files, by their kind."""
import contextlib

from figures_analysis import draw_laws, draw_spectrum, draw_wave, overlay_spectra
from figures_boundary import diagram, draw_boundary, overlay_boundaries
from figures_chart import draw_chart
from figures_cycle import draw_cycle
from figures_fit import draw_fit, draw_lab
from figures_run import RUN_PICTURES, draw_run, movie, overlay
from figures_sweep import draw_sweep
from stickslip import Unusable, reading, text
from style import take_names

KINDS = {"run": draw_run, "laws": draw_laws, "spectrum": draw_spectrum, "wave": draw_wave, "cycle": draw_cycle,
         "boundary": draw_boundary, "chart": draw_chart, "sweep": draw_sweep, "fit": draw_fit}
TOGETHER = {"run": overlay, "boundary": overlay_boundaries, "spectrum": overlay_spectra}


def draw(files, args):
    """The figure for open files of one kind."""
    each = [text(file.attrs.get("kind", "")) for file in files]
    if args.key and each[0] != "sweep":
        raise Unusable(f"holds the result of {each[0]}: --key is for the file of a sweep")
    if args.fails and (each[0] != "chart" or text(files[0].attrs.get("chart_kind", "")) != "limits"):
        raise Unusable(f"holds the result of {each[0]}: --fails is for a chart of limits")
    if each[0] == "sweep" and len(each) > 1 and set(each[1:]) <= {"boundary", "cycle"}:
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
                       "then its boundaries and cycles")
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
            take_names(files[-1])
        args.file = args.files[0]
        try:
            if args.movie and len(files) == 1 and text(files[0].attrs.get("kind", "")) == "run":
                return movie(files[0], args, output)
            figure = draw(files, args)
        except (KeyError, OSError, RuntimeError) as error:
            raise Unusable(f"is damaged or incomplete: {str(error).splitlines()[0]}") from error
    return figure.savefig(output)

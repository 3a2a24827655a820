"""`sysdyn animate`: a trace in motion, as a page or a picture that plays."""

from __future__ import annotations

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.page.figure_sources import destination, label, open_trace, quantities

KINDS = (".html", ".svg")


@with_console("animate")
@click.argument("trace")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "--link",
    "links",
    multiple=True,
    metavar="'X,Y X,Y ...'",
    help="Points that lines join, of quantities or numbers; repeatable.",
)
@click.option("--speed", type=float, metavar="K", help="Seconds of the run in a second.")
@click.option("-o", "output", metavar="FILE.html|.svg", help="Default: the trace's name with .html, here.")
def command(
    console: Console,
    trace: str,
    names: tuple[str, ...],
    links: tuple[str, ...],
    speed: float | None,
    output: str | None,
) -> int:
    """Play TRACE: points that move, and curves of the quantities named with a mark that follows them.

    Without --link each pair of lengths whose names differ by x and y (x1 and y1) is a point. Without names the curves
    are those of all quantities that are no coordinates of points. What lasts 2 to 20 s plays as it was, anything else
    in 8 s. The page loads nothing and works offline; an .svg plays wherever a browser shows it.
    """
    from sysdyn.cli.page import animation

    if speed is not None and not 0.0 < speed < float("inf"):
        raise UsageError(f"--speed {speed:g}: more than 0")
    target, kind = destination(trace, output, console, KINDS, "what plays")
    found = open_trace(trace)
    film = animation.film(found, speed)
    # points by their names, or the links that are given
    joined = animation.links_of(found, links)
    # what moves a point needs no curve
    taken = animation.quantities_of(joined, found)
    drawn = quantities([found], list(names)) if names else [n for n in quantities([found], []) if n not in taken]
    picture = animation.drawing(film, joined, drawn)
    title = str(found.attributes.get("title", label(trace)))
    data = picture if kind == ".svg" else animation.page(title, picture)
    whole_files.write(target, data.encode())
    if target != "-":
        points = ", ".join(" ".join(",".join(point) for point in link) for link in joined)
        console.say(f"{target}: {film.seconds:g} s; points: {points or 'none'}; curves: {', '.join(drawn) or 'none'}")
    console.result = {
        "animation": target,
        "trace": trace,
        "seconds": film.seconds,
        "links": [[list(point) for point in link] for link in joined],
        "quantities": drawn,
    }
    return console.finish()

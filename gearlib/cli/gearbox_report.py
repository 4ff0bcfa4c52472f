"""The page of `gearlib gearbox FILE --report`: tables and pictures of a gearbox in one file."""

import base64
import io
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path

from gearlib.figures import gearbox_figure
from gearlib.studies import gearboxes

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.4 system-ui, sans-serif; color: #222; background: #fff; margin: 1.5em; }}
pre {{ overflow-x: auto; font-size: 12px; }}
td, th {{ padding: 0.2em 0.6em; text-align: left; border-bottom: 1px solid #ddd; }}
img {{ max-width: 100%; }}
</style>
<h1>{title}</h1>
{body}
</html>
"""


def page(file: str, text: str, damping_ratio=0.05, points=101, orders=3, revolutions=60) -> str:
    """Return the HTML page of a gearbox, with its tables and pictures, as a string.

    `file` is the path of a REXS file (an exchange format of gearboxes), `text` the table of the
    gearbox to show first. `damping_ratio` is the damping ratio of each mesh, `points` the number of
    speeds of a stage, `orders` the highest multiple of a mesh frequency in the Campbell diagram,
    `revolutions` the length of the run-up.
    """
    # Pairs (stage, load case), and the load cases in which the whole gearbox can be computed.
    stages, boxes, _ = gearboxes.list_computations(file)
    body = [f"<pre>{escape(text)}</pre>"]
    view = gearboxes.gearbox_outline(file)
    if view.sizes["part"]:
        body += ["<h2>From the side</h2>", _image(gearbox_figure.draw_view(view))]

    def sweep_stage(job):
        """Return dynamic factor and transmission error over speed; `job` is (stage, load case)."""
        return gearboxes.sweep_stage(file, job[0], job[1], damping_ratio, points)

    # Threads run in parallel, because the kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        sweeps = list(pool.map(sweep_stage, stages))
    body += ["<h2>Stages</h2>", _table(gearboxes.stage_rows(sweeps, file))]
    if sweeps:
        body.append(_image(gearbox_figure.draw_stages(sweeps)))
    for case in boxes:
        box = gearboxes.analyse_gearbox(file, case, damping_ratio, orders)
        run = gearboxes.compute_run_up_orders(file, case, damping_ratio, revolutions)
        body += [f"<h2>The whole box, load case {escape(case)}</h2>"]
        body += [_image(gearbox_figure.draw_modes(box))]
        body += [_image(gearbox_figure.draw_run_up(run, box))]
        body += [_table(gearboxes.gearbox_rows([box]))]
    return _PAGE.format(title=escape(Path(file).name), body="\n".join(body))


def _image(figure) -> str:
    """Return a matplotlib figure as an HTML image element that contains its PNG data."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    data = base64.b64encode(content.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="">'


def _table(rows) -> str:
    """Return an HTML table as a string.

    `rows` yields lists of cells; the first one has the names of the columns. Cells are escaped, so
    that characters such as < do not end up as HTML tags.
    """
    header, *value_rows = rows
    names = "".join(f"<th>{escape(name)}</th>" for name in header)
    lines = [f"<tr>{names}</tr>"]
    for row in value_rows:
        cells = "".join(f"<td>{escape(str(value))}</td>" for value in row)
        lines.append(f"<tr>{cells}</tr>")
    return f"<table>{''.join(lines)}</table>"

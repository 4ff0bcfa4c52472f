"""Create the HTML report of `gearlib gearbox FILE --report`: tables and figures of a gearbox."""

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
    """Return an HTML report with tables and figures of a gearbox as a string.

    `file` is the path of a REXS file (an exchange format for gearboxes); `text` describes the
    gearbox and comes first. `damping_ratio` is the damping ratio of each mesh, `points` the number
    of speeds in the sweeps of a stage, `orders` the highest multiple of a mesh frequency in the
    Campbell diagram, and `revolutions` the length of the run-up.
    """
    # `stages` are pairs (stage, load case). In `complete_load_cases`, the whole gearbox can be
    # computed.
    stages, complete_load_cases, _ = gearboxes.list_computations(file)
    body = [f"<pre>{escape(text)}</pre>"]
    view = gearboxes.gearbox_outline(file)
    if view.sizes["part"]:
        body += ["<h2>Side view</h2>", _html_image(gearbox_figure.draw_view(view))]

    def sweep_stage(job):
        """Sweep a stage over speed; `job` is (stage, load case)."""
        return gearboxes.sweep_stage(file, job[0], job[1], damping_ratio, points)

    # The kernels release the interpreter lock, so threads run in parallel.
    with ThreadPoolExecutor(2) as pool:
        sweeps = list(pool.map(sweep_stage, stages))
    body += ["<h2>Stages</h2>", _html_table(gearboxes.stage_rows(sweeps, file))]
    if sweeps:
        body.append(_html_image(gearbox_figure.draw_stages(sweeps)))
    for case in complete_load_cases:
        gearbox = gearboxes.analyse_gearbox(file, case, damping_ratio, orders)
        run = gearboxes.compute_run_up_orders(file, case, damping_ratio, revolutions)
        body += [f"<h2>The whole gearbox, load case {escape(case)}</h2>"]
        body += [_html_image(gearbox_figure.draw_modes(gearbox))]
        body += [_html_image(gearbox_figure.draw_run_up(run, gearbox))]
        body += [_html_table(gearboxes.gearbox_rows([gearbox]))]
    return _PAGE.format(title=escape(Path(file).name), body="\n".join(body))


def _html_image(figure) -> str:
    """Convert a matplotlib figure to an HTML image element with embedded PNG data."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    data = base64.b64encode(content.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="">'


def _html_table(rows) -> str:
    """Convert table rows to an HTML table; the first row has the column names.

    Cells are escaped, because they may contain characters such as <.
    """
    header, *value_rows = rows
    names = "".join(f"<th>{escape(name)}</th>" for name in header)
    lines = [f"<tr>{names}</tr>"]
    for row in value_rows:
        cells = "".join(f"<td>{escape(str(value))}</td>" for value in row)
        lines.append(f"<tr>{cells}</tr>")
    return f"<table>{''.join(lines)}</table>"

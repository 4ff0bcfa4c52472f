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
    """Return the HTML page of a gearbox; `text` is its printed table, others as in `gearboxes`."""
    stages, boxes, _ = gearboxes.jobs(file)
    body = [f"<pre>{escape(text)}</pre>"]
    view = gearboxes.outline(file)
    if view.sizes["part"]:
        body += ["<h2>From the side</h2>", _image(gearbox_figure.draw_view(view))]
    # The kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        found = list(
            pool.map(
                lambda job: gearboxes.stage_over_speed(file, job[0], job[1], damping_ratio, points),
                stages,
            )
        )
    body += ["<h2>Stages</h2>", _table(gearboxes.stage_rows(found, file))]
    if found:
        body.append(_image(gearbox_figure.draw_stages(found)))
    for case in boxes:
        box = gearboxes.whole_box(file, case, damping_ratio, orders)
        run = gearboxes.run_up(file, case, damping_ratio, revolutions)
        body += [f"<h2>The whole box, load case {escape(case)}</h2>"]
        body += [_image(gearbox_figure.draw_modes(box))]
        body += [_image(gearbox_figure.draw_run_up(run, box))]
        body += [_table(gearboxes.box_rows([box]))]
    return _PAGE.format(title=escape(Path(file).name), body="\n".join(body))


def _image(figure) -> str:
    """Return a figure as an image in HTML."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    data = base64.b64encode(content.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" alt="">'


def _table(rows) -> str:
    """Return rows of cells, the names of the columns first, as a table in HTML."""
    header, *others = rows
    cells = [f"<tr>{''.join(f'<th>{escape(x)}</th>' for x in header)}</tr>"]
    cells += [f"<tr>{''.join(f'<td>{escape(str(x))}</td>' for x in row)}</tr>" for row in others]
    return f"<table>{''.join(cells)}</table>"

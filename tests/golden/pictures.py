"""Pictures of the figures against those looked at last: a page for people; nothing rests on it.

Other versions of matplotlib or FreeType draw letters a little differently, so pictures inform and
the numbers behind them (data.py) decide.
"""

import base64
import html
import io
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import ft2font, image

FOLDER = Path(__file__).with_name("pictures")
MADE_WITH = FOLDER / "made_with.txt"

_PAGE = """<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><title>Pictures against those looked at last</title>
<style>body{{font-family:sans-serif;margin:2em}}td{{vertical-align:top;padding:.5em}}
img{{max-width:30em;border:1px solid #ccc}}</style>
<h1>Pictures against those looked at last</h1>
<p>{changed} of {count} differ. Then: {then}. Now: {now}.
The numbers behind the figures decide; these pictures inform.</p>
<table><tr><th>figure</th><th>then</th><th>now</th><th>difference</th></tr>
{rows}
</table></html>
"""


def versions():
    """Return what letters and lines depend on."""
    return f"matplotlib {matplotlib.__version__}, FreeType {ft2font.__freetype_version__}"


def pictures(results):
    """Return the figures as PNG, by name; those of wall times, never twice the same, left out."""
    paths = sorted((Path(results) / "figures").glob("*.png"))
    return {path.stem: path for path in paths if not path.stem.endswith("_time")}


def root_mean_square(then, now):
    """Return the difference of two pictures in grey levels 0-255, inf for other sizes."""
    old, new = (255.0 * image.imread(path)[..., :3] for path in (then, now))
    return float(np.sqrt(np.mean((old - new) ** 2))) if old.shape == new.shape else np.inf


def summary(results, page):
    """Write the page that compares all pictures; return the names of those that differ."""
    found = pictures(results)
    old = {path.stem: path for path in FOLDER.glob("*.png")}
    rows, changed = [], []
    for name in sorted(found | old):
        then, now = old.get(name), found.get(name)
        if then and now:
            distance = root_mean_square(then, now)
            words = f"root mean square {distance:.2f} of 255" if distance else "the same"
        else:
            distance, words = np.inf, "new" if now else "gone"
        if distance:
            changed.append(name)
        cells = [_shown(then), _shown(now), _shown_difference(then, now, distance)]
        row = f"<td>{html.escape(name)}<br>{words}</td>" + "".join(f"<td>{c}</td>" for c in cells)
        # What differs comes first.
        rows.append((not distance, f"<tr>{row}</tr>"))
    then = MADE_WITH.read_text(encoding="utf-8").strip() if MADE_WITH.exists() else "none"
    text = _PAGE.format(
        changed=len(changed),
        count=len(rows),
        then=then,
        now=versions(),
        rows="\n".join(row for _, row in sorted(rows, key=lambda pair: pair[0])),
    )
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text, encoding="utf-8")
    return changed


def _shown(path):
    return _tag(path.read_bytes()) if path else ""


def _shown_difference(then, now, distance):
    """Return the picture of the difference, tenfold, dark on white."""
    if not 0.0 < distance < np.inf:
        return ""
    old, new = (image.imread(path)[..., :3] for path in (then, now))
    buffer = io.BytesIO()
    image.imsave(buffer, 1.0 - np.clip(10.0 * np.abs(old - new), 0.0, 1.0), format="png")
    return _tag(buffer.getvalue())


def _tag(content):
    return f'<img src="data:image/png;base64,{base64.b64encode(content).decode()}" alt="">'

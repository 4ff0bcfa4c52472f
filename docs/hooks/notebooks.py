"""Notebooks as pages: each is run at every build, and its page shows what came of it."""

import base64
import os
import subprocess
import tempfile
from pathlib import Path

import nbformat
from mkdocs.structure.files import File
from nbclient import NotebookClient

#: Seconds for a cell; the first may compile.
_LONGEST = 600
_ABOUT = "*This page is the notebook [{0}]({0}), as it ran when the page was made.*"


def on_files(files, config):
    """Add the page and the pictures of each notebook, which itself stays among the files."""
    for found in [one for one in files if one.src_uri.endswith(".ipynb")]:
        text, pictures = page(run(Path(found.abs_src_path)), found.src_uri)
        files.append(File.generated(config, found.src_uri.replace(".ipynb", ".md"), content=text))
        for name, content in pictures.items():
            files.append(File.generated(config, name, content=content))
    return files


def run(path):
    """Return a notebook with what its cells give, run in an empty folder; an error ends it."""
    notebook = nbformat.read(path, as_version=4)
    # Another backend than that of notebooks shows nothing.
    environment = {name: text for name, text in os.environ.items() if name != "MPLBACKEND"}
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook, timeout=_LONGEST, resources={"metadata": {"path": folder}}
        )
        # Kernels warn that what they do is not encrypted; it does not leave this machine.
        client.execute(env=environment, stderr=subprocess.DEVNULL)
    return notebook


def page(notebook, name):
    """Return a notebook that was run as Markdown, and the bytes of its pictures by their names."""
    parts, pictures = [], {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source.removesuffix(';')}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                picture = f"{name.removesuffix('.ipynb')}_{len(pictures) + 1}.png"
                pictures[picture] = base64.b64decode(data["image/png"])
                parts.append(f"![What the cell shows]({Path(picture).name}){{ width=640 }}")
                continue
            # What the kernels and Snakemake say while they work is no result.
            printed = output.text if output.get("name") == "stdout" else data.get("text/plain", "")
            if printed.strip():
                parts.append(f"```text\n{printed.rstrip()}\n```")
    parts.insert(1, _ABOUT.format(Path(name).name))
    return "\n\n".join(parts), pictures

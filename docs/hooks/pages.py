"""Pages from other files: the notebook, run at every build, CONTRIBUTING.md and CHANGELOG.md.

Pages link to these files, so that the links work in plain files too.
"""

import os
import re
import subprocess
import tempfile
from pathlib import Path

import nbformat
from mkdocs.structure.files import File
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

_NOTE = "\n*This page is the notebook [{0}]({0}), as it ran when the page was made.*\n\n## "


def on_files(files, config):
    """Add the pages, and the pictures of the notebook."""
    contents = {}
    for name in ("CONTRIBUTING.md", "CHANGELOG.md"):
        text = Path(config.config_file_path).with_name(name).read_text(encoding="utf-8")
        contents[name.lower()] = text.replace("](docs/", "](")
    for notebook in [file for file in files if file.src_uri.endswith(".ipynb")]:
        contents |= run(Path(notebook.abs_src_path))
    for name, content in contents.items():
        files.append(File.generated(config, name, content=content))
    return files


def run(path):
    """Run a notebook in an empty folder; return its page and pictures by name."""
    notebook = nbformat.read(path, as_version=4)
    environment = os.environ | {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": folder}})
        # On stderr, kernels warn that their connection within this machine is not encrypted.
        client.execute(env=environment, stderr=subprocess.DEVNULL)
    for cell in notebook.cells:
        # Messages of Snakemake are no results.
        cell["outputs"] = [out for out in cell.get("outputs", []) if out.get("name") != "stderr"]
    names = {"unique_key": path.stem}
    text, resources = MarkdownExporter().from_notebook_node(notebook, names)
    text = text.replace("\n## ", _NOTE.format(path.name), 1)
    return {f"{path.stem}.md": text} | resources["outputs"]


def on_page_markdown(markdown, page, **_):
    """Let the links to these files lead to their pages."""
    markdown = re.sub(r"\]\((\.\./)?((?:\.\./)*)CONTRIBUTING\.md", r"](\2contributing.md", markdown)
    if page.file.src_uri != "from_geometry.md":
        markdown = markdown.replace("](from_geometry.ipynb)", "](from_geometry.md)")
    return markdown

"""CONTRIBUTING.md and CHANGELOG.md, which lie in the root of the project, as pages of the site.

Pages link to these files and to the notebook so that the links work in plain files too.
"""

import re
from pathlib import Path

from mkdocs.structure.files import File

PAGES = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}


def on_files(files, config):
    """Add both; their links into docs/ become links of the site."""
    root = Path(config.config_file_path).parent
    for source, page in PAGES.items():
        text = (root / source).read_text(encoding="utf-8").replace("](docs/", "](")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown, page, **_):
    """Return a page with links to the pages that the site makes of these files."""
    up = "../" * page.file.src_uri.count("/")
    markdown = re.sub(r"\]\((?:\.\./)*CONTRIBUTING\.md", f"]({up}contributing.md", markdown)
    if page.file.src_uri != "from_a_drawing.md":
        markdown = markdown.replace("](from_a_drawing.ipynb)", "](from_a_drawing.md)")
    return markdown

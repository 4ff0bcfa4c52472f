"""The page `reference/command_line.md`: what ``--help`` says, command by command."""

import click
from mkdocs.structure.files import File

from gearlib.cli.commands import main

PAGE = "reference/command_line.md"
_HEAD = """# Command line

What `gearlib --help` and the help of each command say. [How to use it](../how_to/command_line.md).
"""


def on_files(files, config):
    """Add the page."""
    files.append(File.generated(config, PAGE, content=reference()))
    return files


def reference():
    """Return the page as Markdown."""
    top = click.Context(main, info_name="gearlib", max_content_width=96, terminal_width=96)
    parts = [_HEAD, _help("gearlib", main.get_help(top))]
    for name, command in main.commands.items():
        inside = click.Context(command, info_name=name, parent=top, terminal_width=96)
        parts.append(_help(f"gearlib {name}", command.get_help(inside)))
    return "\n".join(parts)


def _help(title, text):
    return f"## {title}\n\n```text\n{text}\n```\n"

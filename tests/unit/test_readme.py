"""The Python of the README runs as it stands."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_python_blocks_run(tmp_path, monkeypatch):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)
    assert blocks
    monkeypatch.chdir(tmp_path)
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert (tmp_path / "resonance.png").stat().st_size > 1000

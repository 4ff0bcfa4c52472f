"""Refusals: one sentence each."""

import re


def assert_sentence(error, sentence, most=500):
    """Assert that an error is one sentence that begins so; `...` stands for anything."""
    text, parts = str(error), re.split(r"\s*\.\.\.\s*", sentence)
    assert re.match(".*".join(map(re.escape, parts)), text), text
    assert "\n" not in text and not re.search(r"[^.]\. ", text) and len(text) < most, text

"""Check that an error message is a single sentence."""

import re


def assert_sentence(error, beginning, max_length=500):
    """Assert that an error message is a single sentence with a given beginning.

    `...` in the beginning matches any text. The message must be shorter than `max_length`.
    """
    message, fragments = str(error), re.split(r"\s*\.\.\.\s*", beginning)
    assert re.match(".*".join(map(re.escape, fragments)), message), message
    assert "\n" not in message and not re.search(r"[^.]\. ", message), message
    assert len(message) < max_length, message

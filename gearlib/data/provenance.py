"""The origin of a dataset, in its attributes: canonical, without times, machines or commits.

Two runs of the same calculation must give the same bytes, so whatever changes between them
stays out of the files.
"""

import hashlib
import json
import math
from pathlib import Path

from gearlib.version import __version__


def canonical_json(value):
    """Return JSON with sorted keys and plain numbers, the same text for the same content."""
    return json.dumps(_plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value):
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and math.isinf(value):
        # JSON knows no infinity; an infinite backlash is written as text.
        return "inf" if value > 0 else "-inf"
    return value


def origin(title, method=None):
    """Return the attributes that every dataset has."""
    source = f"gearlib {__version__}" + (f", method {method}" if method else "")
    return {"Conventions": "CF-1.11", "title": title, "source": source}


def _parameters_of(model):
    """Return the parameters of a model as text; it keeps them, as it does not change."""
    kept = vars(model)
    return kept.get("_text") or kept.setdefault("_text", canonical_json(model.as_dict()))


def attributes(title, pair, *, method, **parameters):
    """Return the global attributes of a dataset, in a fixed order."""
    return origin(title.replace("a gear mesh", pair.title_noun), method) | {
        "references": pair.references,
        "gear_pair" if pair.mesh else "model": _parameters_of(pair),
        "parameters": canonical_json(parameters),
        **({"comment": pair.force_note} if pair.force_note else {}),
    }


class _Sources:
    """The source files on which the results of this process depend: all of the package, or fewer.

    The workflow knows which files a job depends on, and reruns it when one of them changes. Only
    these may count: a file that is not computed anew has to equal one that is.
    """

    paths = sorted(Path(__file__).parent.rglob("*.py"))
    digest = None


def declare_sources(paths):
    """State that results depend on these files alone; their order counts, their folders do not."""
    _Sources.paths, _Sources.digest = [Path(path) for path in paths], None


def source_hash():
    """Return the hash (16 hex digits) of the declared sources, else of the whole package."""
    if _Sources.digest is None:
        digest = hashlib.sha256()
        for path in _Sources.paths:
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
        _Sources.digest = digest.hexdigest()[:16]
    return _Sources.digest

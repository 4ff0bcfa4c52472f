"""What may be changed in a text of Python: an operator, a constant, a term, arguments, a branch.

A mutation is known by its file, its function, the text of its lines and what becomes of them, never
by the number of a line, so that an edit elsewhere leaves samples and verdicts as they are.
"""

import ast
import hashlib
import io
import re
import tokenize
from bisect import bisect, bisect_left
from dataclasses import dataclass
from itertools import accumulate, islice, zip_longest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Rooms by how their files begin; the longest beginning counts.
ROOMS = """
analysis analysis/global_dynamics analysis/harmonics analysis/orbits analysis/proofs
analysis/tongues checks cli config data figures integrators kernels kernels/closed_form
kernels/several_meshes kernels/slopes kernels/steps kernels/taylor kernels/tooth_pairs
models models/geometry models/propagators models/trains notebook pages parameters plot processor rig
runs studies studies/claims studies/trains studies/trials tolerances tunings
"""
ROOMS = {f"gearlib/{room}": room for room in ROOMS.split()} | {"workflow/": "workflow"}
_NAMES = ("gearlib/__init__.py", "gearlib/geometry.py", "gearlib/version.py")
#: Others' packages, which are not installed for the tests; what is run by hand; names.
LEFT_OUT = ("gearlib/integrators/peers/", "gearlib/__main__.py", *_NAMES)

_SIGNS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"), ast.Mod: ("%", "*"), ast.Pow: ("**", "*"), ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}  # fmt: skip
_COMPARED = {
    ast.Lt: ("<", "<=", ">"), ast.LtE: ("<=", "<", ">="), ast.Gt: (">", ">=", "<"),
    ast.GtE: (">=", ">", "<="), ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"), ast.IsNot: (r"is\s+not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: (r"not\s+in", "in"),
}  # fmt: skip
#: Functions that do not ask for the order of their arguments.
_SYMMETRIC = {"gcd", "hypot", "isclose", "lcm", "max", "maximum", "min", "minimum"}


@dataclass(frozen=True)
class Mutation:
    """A replacement of one stretch of a file."""

    file: str
    where: str  #: the function, or class, that holds it
    kind: str
    line: int
    last: int
    source: str  #: the lines that it changes
    mutated: str  #: and what becomes of them
    change: tuple  #: where it begins and ends in the text, and what is written there

    def planted(self, root=ROOT):
        """Return the text of the file with the mutation in it."""
        text = (root / self.file).read_text(encoding="utf-8")
        begin, end, new = self.change
        return text[:begin] + new + text[end:]

    @property
    def key(self):
        """What names it, here and in the list of verdicts."""
        return (self.file, self.where, self.source, self.mutated)

    def rank(self, seed):
        """Return its place in a sample: as good as random, and the same after any edit."""
        return hashlib.sha256(repr((seed, *self.key)).encode()).hexdigest()


def room_of(file):
    """Return the room of a file, or None for one that is left out."""
    if file.startswith(LEFT_OUT):
        return None
    return next(
        (ROOMS[start] for start in sorted(ROOMS, reverse=True) if file.startswith(start)), None
    )


def files(root=ROOT):
    """Return the files that may be changed, below the root."""
    found = [
        *root.glob("gearlib/**/*.py"),
        *root.glob("workflow/**/*.py"),
        *root.glob("workflow/**/*.smk"),
    ]
    return sorted(name for path in found if room_of(name := path.relative_to(root).as_posix()))


def mutations(file, root=ROOT):
    """Return all mutations of a file; those that write the same text twice count once."""
    text = (root / file).read_text(encoding="utf-8")
    changes = _of_tokens(text) if file.endswith(".smk") else _Changes(text).found
    starts, found = _starts(text), {}
    for where, kind, begin, end, new in changes:
        first, last = bisect(starts, begin) - 1, bisect_left(starts, end) - 1
        head, tail = text[starts[first] : begin], text[end : starts[last + 1]]
        source, mutated = (" ".join((head + x + tail).split()) for x in (text[begin:end], new))
        if source != mutated:
            one = Mutation(
                file, where, kind, first + 1, last + 1, source, mutated, (begin, end, new)
            )
            found.setdefault(one.key, one)
    return list(found.values())


def _starts(text):
    return [0, *accumulate(map(len, text.splitlines(keepends=True)))]


def sample(room, count, seed, root=ROOT, part=""):
    """Return so many mutations of a room: of each kind in turn, as long as there are any.

    Those of files whose path has the part in it.
    """
    kinds = {}
    for file in files(root):
        if room_of(file) == room and part in file:
            for one in mutations(file, root):
                kinds.setdefault(one.kind, []).append(one)
    queues = [sorted(kinds[kind], key=lambda one: one.rank(seed)) for kind in sorted(kinds)]
    turns = (one for turn in zip_longest(*queues) for one in turn if one and _parses(one, root))
    return list(islice(turns, count))


def _parses(one, root):
    try:
        return one.file.endswith(".smk") or bool(ast.parse(one.planted(root)))
    except SyntaxError:
        return False


class _Changes(ast.NodeVisitor):
    """All changes of a text: function, kind, beginning, end and what is written there."""

    def __init__(self, text):
        self.text, self.found, self.names = text, [], []
        self.starts, self.lines = _starts(text), text.splitlines(keepends=True)
        self.visit(ast.parse(text))

    def place(self, line, column):
        # Columns count bytes.
        return self.starts[line - 1] + len(self.lines[line - 1].encode()[:column].decode())

    def span(self, node):
        return self.place(node.lineno, node.col_offset), self.place(
            node.end_lineno, node.end_col_offset
        )

    def put(self, kind, begin, end, new):
        self.found.append((".".join(self.names), kind, begin, end, new))

    def between(self, kind, left, right, old, *new):
        begin, end = self.span(left)[1], self.span(right)[0]
        pattern = old if re.search(r"\w", old) else re.escape(old)
        sign = re.search(rf"(?:#[^\n]*\n|[\s()])*?({pattern})", self.text[begin:end])
        for other in new if sign else ():
            self.put(kind, begin + sign.start(1), begin + sign.end(1), other)

    def drop(self, node, *kept):
        for one in kept:
            begin, end = self.span(one)
            self.put("dropped term", *self.span(node), f"({self.text[begin:end]})")

    def swap(self, one, other):
        (a, b), (c, d) = self.span(one), self.span(other)
        text = self.text
        if not isinstance(one, ast.Starred) and not isinstance(other, ast.Starred):
            self.put("swapped", a, d, text[c:d] + text[b:c] + text[a:b])

    def turn(self, condition):
        begin, end = self.span(condition)
        for new in (f"(not ({self.text[begin:end]}))", "True", "False"):
            self.put("branch", begin, end, new)
        self.generic_visit(condition)

    def scoped(self, node):
        if isinstance(node, ast.ClassDef):
            parts = [*node.decorator_list, *node.bases, *node.body]
        else:
            parts = [*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body]
        self.names.append(node.name)
        for part in parts:
            self.visit(part)
        self.names.pop()

    visit_FunctionDef = visit_ClassDef = scoped

    def visit_AnnAssign(self, node):
        if node.value:
            self.visit(node.value)

    def visit_If(self, node):
        if getattr(node.test, "id", "") != "TYPE_CHECKING":
            self.turn(node.test)
            self.visit(node.test)
            for part in [*node.body, *node.orelse]:
                self.visit(part)

    def visit_IfExp(self, node):
        self.turn(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node):
        for condition in node.ifs:
            self.turn(condition)
        self.generic_visit(node)

    def visit_BinOp(self, node):
        if type(node.op) in _SIGNS and not isinstance(node.left, ast.JoinedStr):
            self.between("operator", node.left, node.right, *_SIGNS[type(node.op)])
        if isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
            self.drop(node, node.left, node.right)
        elif isinstance(node.op, ast.Div | ast.Pow):
            self.drop(node, node.left)
        if isinstance(node.op, ast.MatMult | ast.Sub | ast.Div):
            self.swap(node.left, node.right)
        self.generic_visit(node)

    def visit_AugAssign(self, node):
        if type(node.op) in _SIGNS:
            old, new = _SIGNS[type(node.op)]
            self.between("operator", node.target, node.value, f"{old}=", f"{new}=", "=")
        self.visit(node.value)

    def visit_UnaryOp(self, node):
        if isinstance(node.op, ast.USub | ast.Not):
            begin, end = self.span(node.operand)
            kind = "operator" if isinstance(node.op, ast.USub) else "branch"
            self.put(kind, *self.span(node), f" {self.text[begin:end]}")
        self.generic_visit(node)

    def visit_BoolOp(self, node):
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.between("branch", left, right, rf"\b{old}\b", new)
        self.drop(node, node.values[0], node.values[-1])
        self.generic_visit(node)

    def visit_Compare(self, node):
        values = [node.left, *node.comparators]
        for sign, left, right in zip(node.ops, values, values[1:], strict=False):
            self.between("comparison", left, right, *_COMPARED[type(sign)])
        self.generic_visit(node)

    def visit_Call(self, node):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        for one, other in zip(node.args, node.args[1:], strict=False):
            if name not in _SYMMETRIC:
                self.swap(one, other)
        # A check that what runs side by side is equally long: nothing fails without it.
        node.keywords = [word for word in node.keywords if word.arg != "strict"]
        self.generic_visit(node)

    def visit_Constant(self, node):
        value = node.value
        if isinstance(value, bool):
            self.put("constant", *self.span(node), str(not value))
        elif isinstance(value, int):
            for other in {value + 1, value - 1 if value > 0 else 2}:
                self.put("constant", *self.span(node), str(other))
        elif isinstance(value, float):
            self.put("constant", *self.span(node), repr(1.0 if value == 0.0 else 1.25 * value))

    def visit_JoinedStr(self, node):
        """Positions inside of it are those of Python 3.12 and later only."""


def _of_tokens(text):
    """Return changes of a file that only Snakemake can parse, from its tokens."""
    others = {"==": "!=", "!=": "==", "<": ">", ">": "<", "+": "-", "-": "+"}
    words = {"and": "or", "or": "and", "not": "", "in": "not in", "True": "False", "False": "True"}
    starts, where, before = _starts(text), "", ""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        begin = starts[token.start[0] - 1] + token.start[1]
        end = starts[token.end[0] - 1] + token.end[1]
        if before in ("def", "rule", "use"):
            where = token.string
        kind, new = "operator", others.get(token.string) if token.type == tokenize.OP else None
        if token.type == tokenize.NUMBER and token.string.isdigit():
            kind, new = "constant", str(int(token.string) + 1)
        elif token.type == tokenize.NAME and not (token.string == "in" and before in ("not", "")):
            kind, new = "branch", words.get(token.string)
        # The `in` of a loop or of a comprehension is no comparison.
        line = text[starts[token.start[0] - 1] : begin]
        if new is not None and not (token.string == "in" and re.search(r"\bfor\b[^\]})]*$", line)):
            yield where, kind, begin, end, new
        if token.type in (tokenize.NAME, tokenize.OP, tokenize.STRING):
            before = token.string

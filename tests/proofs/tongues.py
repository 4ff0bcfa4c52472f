"""The second program on tongues: their edges, and that deviations grow between them."""

from mpmath import iv

from tests.proofs.duals import Dual
from tests.proofs.meshes import Mesh


def _excess(mesh, sign, nu):
    """Return det(M - sign I) of the mesh that is never lost, from its own deviations."""
    total = [None, None, None]
    for i, start in enumerate(((0, 0), (1, 0), (0, 1))):
        x, v = Dual(iv.mpf(start[0])), Dual(iv.mpf(start[1]))
        for low, length in ((0, mesh.half), (1, 2 * (iv.pi - mesh.half)), (0, mesh.half)):
            x, v = mesh.move(1, low, nu, x, v, Dual(length))
        total[i] = x, v
    (a, c), (b, d) = [(x - total[0][0], v - total[0][1]) for x, v in total[1:]]
    return (1 - a * sign) * (1 - d * sign) - b * c


def tongue_faults(claim, share=0.25):
    """Return what is not confirmed of a tongue: a zero at each edge, growth between them.

    That there is no other edge near is confirmed in a share of the intervals only.
    """
    mesh, sign = Mesh(claim["pair"]), claim["multiplier"]
    lower, upper = [iv.mpf(claim[edge]) for edge in ("start", "stop")]
    ends = [_excess(mesh, sign, Dual(iv.mpf(end))) for end in (lower.a, lower.b, upper.a, upper.b)]
    found = []
    if not (ends[0] > 0 and ends[1] < 0 and ends[2] < 0 and ends[3] > 0):
        found.append("edges")
    for edge, interval in ((lower, "start_interval"), (upper, "stop_interval")):
        near = iv.mpf(edge.mid) + (iv.mpf(claim[interval]) - edge.mid) * share
        if 0 in _excess(mesh, sign, Dual(near, [iv.mpf(1)])).slopes[0]:
            found.append("uniqueness")
    todo = [iv.mpf([lower.b, upper.a])]
    for _ in range(4000):
        if not todo:
            return found
        piece = todo.pop()
        value = _excess(mesh, sign, Dual(piece, [iv.mpf(1)]))
        # Next to an edge, where it is negative already, it goes on falling or rising.
        slope = Dual(value.slopes[0])
        if value > 0:
            break
        if value < 0 or (piece.a == lower.b and slope < 0) or (piece.b == upper.a and slope > 0):
            continue
        middle = piece.mid
        todo += [iv.mpf([piece.a, middle]), iv.mpf([middle, piece.b])]
    return [*found, "growth"]

"""Writes polygon_pairs_hard.json: exchange areas of hard pairs of polygons, with mpmath (pip install mpmath).

The corners are f64 numbers and taken as exact. Each polygon is cut at the other's plane; then
A1 F12 = 1/(2 pi) sum over edge pairs of (e_i . e_j) int int ln r ds dt, inner integral exact, outer one by mpmath's tanh-sinh rule
between the feet of the other edge's ends and the place where the lines are nearest, with 60 digits. The sum is made twice, with the
roles of the polygons exchanged; only agreeing digits are written (at least 20).
"""

import json
import math
from pathlib import Path

from mpmath import mp, mpf, matrix, quad, log, atan2, sqrt, pi, nstr, fabs, log10

mp.dps = 60


def vec(v):
    return [mpf(x) for x in v]


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b)), mpf(0))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def along(a, t, d):
    return [x + t * y for x, y in zip(a, d)]


def area_vector(p):
    total = [mpf(0)] * 3
    for a, b in zip(p[1:], p[2:]):
        total = [x + y / 2 for x, y in zip(total, cross(sub(a, p[0]), sub(b, p[0])))]
    return total


def cut(p, plane):
    normal = area_vector(plane)
    h = [dot(normal, sub(v, plane[0])) for v in p]
    out = []
    for k, a in enumerate(p):
        b, ha, hb = p[(k + 1) % len(p)], h[k], h[(k + 1) % len(p)]
        if ha >= 0:
            out.append(a)
        if (ha > 0 and hb < 0) or (ha < 0 and hb > 0):
            out.append(along(a, ha / (ha - hb), sub(b, a)))
    return out if max(h) > 0 else []


def edges(p):
    pairs = [(a, p[(k + 1) % len(p)]) for k, a in enumerate(p)]
    return [(a, sub(b, a)) for a, b in pairs if any(sub(b, a))]


def inner(y, start, e):
    w = sub(start, y)
    end = along(w, 1, e)
    ee = dot(e, e)
    term = lambda c: dot(c, e) / ee * log(dot(c, c)) if dot(c, c) > 0 else mpf(0)
    c = cross(w, e)
    h = sqrt(dot(c, c))
    return (term(end) - term(w)) / 2 - 1 + h / ee * atan2(h, dot(w, end))


def pair(a, d, b, e):
    weight = dot(d, e)
    if weight == 0:
        return mpf(0)
    dd = dot(d, d)
    feet = [(dot(sub(c, a), d) / dd, sub(c, a)) for c in (b, along(b, 1, e))]
    places = [(x, sqrt(dot(along(w, -x, d), along(w, -x, d)) / dd)) for x, w in feet]
    n = cross(d, e)
    nn = dot(n, n)
    if nn > 0:
        w = sub(b, a)
        places.append((dot(cross(w, e), n) / nn, fabs(dot(w, n)) * sqrt(dot(e, e)) / nn))
    cuts = {mpf(0), mpf(1)}
    for x, y in places:
        x = min(max(x, mpf(0)), mpf(1))
        cuts.add(x)
        step = max(y, mpf(10) ** -30)
        while step < 1:
            cuts.update(c for c in (x - step, x + step) if 0 < c < 1)
            step *= 8
    return weight * quad(lambda s: inner(along(a, s, d), b, e), sorted(cuts))


def exchange(p, q):
    p, q = [vec(v) for v in p], [vec(v) for v in q]
    a, b = cut(p, q), cut(q, p)
    if not a or not b:
        return mpf(0), False
    forth = sum((pair(*i, *j) for i in edges(a) for j in edges(b)), mpf(0)) / (2 * pi)
    back = sum((pair(*j, *i) for i in edges(a) for j in edges(b)), mpf(0)) / (2 * pi)
    digits = -log10(max(fabs(forth / back - 1), mpf(10) ** -40))
    assert digits > 20, (nstr(forth, 30), nstr(back, 30))
    return forth, len(a) != len(p) or len(b) != len(q)


def wedge(angle_deg, p, q):
    """p lies in z = 0 at y > 0; q, given at y > 0 in z = 0, is turned about the x axis by the dihedral angle."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return p, [(x, y * c, y * s) for x, y, _ in q][::-1]


TRI = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 0.8, 0.0)]
OTHER = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.6, 0.7, 0.0)]
SHIFTED = [(0.4, 0.0, 0.0), (1.7, 0.0, 0.0), (0.6, 0.7, 0.0)]
CORNER = [(0.0, 0.0, 0.0), (0.9, 0.5, 0.0), (0.2, 0.7, 0.0)]


def turned(p, shift=(0.0, 0.0, 0.0), scale=1.0):
    """A rotation about (1, 2, 2)/3 by atan2(4, 3), a scaling and a shift."""
    out = []
    for v in p:
        k = (1 / 3, 2 / 3, 2 / 3)
        kv = sum(a * b for a, b in zip(k, v))
        kx = (k[1] * v[2] - k[2] * v[1], k[2] * v[0] - k[0] * v[2], k[0] * v[1] - k[1] * v[0])
        out.append(tuple(scale * (0.6 * v[i] + 0.8 * kx[i] + 0.4 * kv * k[i]) + shift[i] for i in range(3)))
    return out


def cases():
    for angle in (1e-3, 0.1, 120.0, 179.0, 179.9, 179.999):
        yield f"shared edge, dihedral {angle} deg", *wedge(angle, TRI, OTHER)
    for angle in (1e-3, 60.0, 179.9, 179.999):
        yield f"overlapping collinear edges, dihedral {angle} deg", *wedge(angle, TRI, SHIFTED)
    for angle in (30.0, 179.0, 179.999):
        yield f"shared vertex, planes at {angle} deg", *wedge(angle, TRI, CORNER)
    for gap in (1e-6, 1e-9):
        lifted = [(x, y, gap) for x, y, _ in [(0.1, 0.1, 0.0), (0.9, -0.2, 0.0), (0.5, 0.6, 0.0)]]
        yield f"parallel triangles, gap {gap}", TRI, lifted[::-1]
        beside = [(x, -y, gap) for x, y, _ in OTHER]
        yield f"parallel triangles side by side, gap {gap}", TRI, beside
        apart = [(x, -y - 0.5, gap) for x, y, _ in OTHER]
        yield f"parallel triangles apart sideways, gap {gap}", TRI, apart
        yield f"skew triangle, gap {gap}", TRI, [(0.1, 0.2, gap), (0.5, 0.9, 0.4), (0.9, 0.1, 0.3)]
        yield f"perpendicular, edge over the interior, gap {gap}", TRI, [(0.2, 0.3, gap), (0.5, 0.3, 0.7), (0.7, 0.3, gap)]
        yield f"crossing edges, gap {gap}", TRI, [(0.4, -0.3, gap), (0.3, -0.2, 0.6), (0.5, 0.5, gap)]
        yield f"nearly coplanar, gap {gap}", TRI, [(0.0, -gap, 2 * gap), (0.6, -0.8, 1e-5), (1.0, -gap, gap)]
    for width in (1e-4, 1e-6):
        thin = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, width, 0.0)]
        yield f"sliver {width} on a shared edge, 90 deg", *wedge(90.0, thin, OTHER)
        yield f"sliver {width} on a shared edge, 179 deg", *wedge(179.0, thin, OTHER)
        yield f"two slivers {width} on a shared edge, 70 deg", *wedge(70.0, thin, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 2 * width, 0.0)])
        yield f"sliver {width} across, gap 1e-6", TRI, [(0.2, -0.4, 1e-6), (0.2 + width, 0.1, 1e-6), (0.2, 0.9, 1e-6)][::-1]
    for distance in (1e3, 1e6):
        yield f"far {distance}, facing", TRI, [(x, y, distance) for x, y, _ in OTHER][::-1]
        yield f"far {distance}, grazing", TRI, [(distance, 0.25, 0.5), (distance, 1.0, 0.25), (distance, 0.5, 1.5)][::-1]
        yield f"far {distance}, grazing, cut", TRI, [(distance, 0.25, -0.5), (distance, 1.0, 0.25), (distance, 0.5, 1.5)][::-1]
    for size in (1e-3, 1e-6):
        yield f"size ratio {size}, on the edge", *wedge(75.0, TRI, [(0.4, 0.0, 0.0), (0.4 + size, 0.0, 0.0), (0.4, size, 0.0)])
        yield f"size ratio {size}, over the interior", TRI, [(0.4, 0.3, size), (0.4, 0.3 + size, size), (0.4 + size, 0.3, 2 * size)]
        yield f"size ratio {size}, in a corner", *wedge(100.0, TRI, [(0.0, 0.0, 0.0), (size, 0.0, 0.0), (0.0, size, 0.0)])
        yield f"horizon leaves {size}", TRI, [(0.2, 0.1, -0.4), (0.5, 0.9, size), (0.9, -0.2, -0.5)][::-1]
        yield f"horizon leaves a strip {size}", TRI, [(0.2, 0.1, size), (0.9, -0.2, -0.5), (0.5, 0.9, size)]
    yield "a corner in the other's interior", TRI, [(0.4, 0.25, 0.0), (0.9, 0.5, 0.75), (0.125, 0.75, 0.5)][::-1]
    yield "an edge in the other's plane, across it", TRI, [(0.125, -0.5, 0.0), (0.25, 0.25, 0.75), (0.5, 0.75, 0.0)]
    ell = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 2.0, 0.0), (0.0, 2.0, 0.0)]
    yield "L shapes, facing", ell, [(x, y, 0.5) for x, y, _ in ell][::-1]
    yield "L shapes, cut in two by the horizon", ell, [(2.5, y - 0.5, x - 1.25) for x, y, _ in ell]
    yield "a star over an L", ell, [(1.0, 0.0, 1.0), (0.25, 0.25, 1.0), (0.0, 1.0, 1.0), (-0.25, 0.25, 1.0), (-1.0, 0.0, 1.0), (-0.25, -0.25, 1.0), (0.0, -1.0, 1.0), (0.25, -0.25, 1.0)][::-1]
    p, q = wedge(150.0, TRI, OTHER)
    yield "turned and shifted by 1000", turned(p, (1000.0, -1000.0, 500.0)), turned(q, (1000.0, -1000.0, 500.0))
    yield "turned, 1e-6 of the size", turned(p, scale=1e-6), turned(q, scale=1e-6)
    yield "turned, 1e6 times the size", turned(p, scale=1e6), turned(q, scale=1e6)
    p, q = wedge(179.99, TRI, OTHER)
    yield "nearly coplanar, turned", turned(p), turned(q)


def main():
    out = []
    for name, p, q in cases():
        value, is_cut = exchange(p, q)
        print(name, nstr(value, 20), is_cut, flush=True)
        out.append({"name": name, "p": p, "q": q, "exchange_area": nstr(value, 20), "cut": is_cut})
    lines = ",\n".join(json.dumps(case) for case in out)
    Path(__file__).with_suffix(".json").write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    main()

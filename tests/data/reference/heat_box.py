"""Writes heat_box.json: temperatures and net heats in closed boxes with random emissivities and conditions, by numpy's dense solver (pip install numpy).

Every side of a box of 2 x 1 x 1.5 m is cut into 2 x 2 patches. Form factors between these are the closed forms of parallel and of perpendicular rectangles (Ehlert and Smith 1993). The unknowns are B and M of
every patch: B = e M + (1 - e) F B, and for each patch its given M = sigma T^4, B - F B = supplied, or M equal to that of the node's first patch, whose own equation is the node's sum of A (B - F B).
"""

import json
from itertools import product
from math import atan, log, pi, sqrt
from pathlib import Path

import numpy as np

SIGMA = 5.670374419e-8
SIZE = (2.0, 1.0, 1.5)
SIDES = ["x0", "x1", "y0", "y1", "z0", "z1"]


def rectangles():
    found = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in range(2):
            for a, b in product(range(2), range(2)):
                half = [SIZE[u] / 2, SIZE[v] / 2]
                found.append(
                    {
                        "side": 2 * axis + end,
                        "axis": axis,
                        "at": end * SIZE[axis],
                        "range": {u: (a * half[0], (a + 1) * half[0]), v: (b * half[1], (b + 1) * half[1])},
                        "area": half[0] * half[1],
                    }
                )
    return found


def times_atan(a, c):
    return a * c * atan(a / c) if c > 0 else 0.0


def parallel(p, q):
    u, v = p["range"].keys()
    z = abs(p["at"] - q["at"])
    total = 0.0
    for i, j, k, l in product(range(2), repeat=4):
        x, y = p["range"][u][i] - q["range"][u][k], p["range"][v][j] - q["range"][v][l]
        g = times_atan(y, sqrt(x * x + z * z)) + times_atan(x, sqrt(y * y + z * z)) - z * z / 2 * log(x * x + y * y + z * z)
        total += (-1) ** (i + j + k + l) * g / (2 * pi)
    return total


def perpendicular(p, q):
    (common,) = set(p["range"]) & set(q["range"])
    xs = [abs(x - q["at"]) for x in p["range"][q["axis"]]]
    xis = [abs(x - p["at"]) for x in q["range"][p["axis"]]]
    total = 0.0
    for i, j, k, l in product(range(2), repeat=4):
        x, y = sorted(xs)[i], p["range"][common][j]
        eta, xi = q["range"][common][k], sorted(xis)[l]
        d, s = y - eta, x * x + xi * xi
        g = times_atan(d, sqrt(s)) - (s - d * d) / 4 * (log(s + d * d) if s + d * d > 0 else 0.0)
        total += (-1) ** (i + j + k + l) * g / (2 * pi)
    return total


def exchange_area(p, q):
    if p["side"] == q["side"]:
        return 0.0
    if p["axis"] == q["axis"]:
        return parallel(p, q)
    return perpendicular(p, q)


def solve(rects, f, areas, emissivity, conditions, supplied_w):
    n = len(rects)
    a, b = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    first_of_node = {}
    for i, rect in enumerate(rects):
        e = emissivity[rect["side"]]
        a[i, :n] = np.eye(n)[i] - (1 - e) * f[i]
        a[i, n + i] = -e
        kind, value = conditions[rect["side"]]
        if kind == "temperature_k":
            a[n + i, n + i], b[n + i] = 1.0, SIGMA * value**4
        elif kind == "supplied_w_m2":
            a[n + i, :n], b[n + i] = np.eye(n)[i] - f[i], value
        elif value in first_of_node:
            a[n + i, n + i], a[n + i, n + first_of_node[value]] = 1.0, -1.0
        else:
            first_of_node[value] = i
            b[n + i] = supplied_w[value]
            for j, other in enumerate(rects):
                if conditions[other["side"]] == (kind, value):
                    a[n + i, :n] += areas[j] * (np.eye(n)[j] - f[j])
    x = np.linalg.solve(a, b)
    flux = x[:n] - f @ x[:n]
    surfaces = {}
    for k, name in enumerate(SIDES):
        own = [i for i, rect in enumerate(rects) if rect["side"] == k]
        mean = sum(areas[i] * x[n + i] for i in own) / sum(areas[i] for i in own)
        surfaces[name] = {
            "temperature_k": (mean / SIGMA) ** 0.25,
            "net_heat_w": sum(areas[i] * flux[i] for i in own),
        }
    return surfaces


def main():
    rects = rectangles()
    areas = np.array([rect["area"] for rect in rects])
    f = np.array([[exchange_area(p, q) for q in rects] for p in rects]) / areas[:, None]
    assert abs(f.sum(axis=1) - 1).max() < 1e-12
    rng = np.random.default_rng(40)
    cases = []
    for _ in range(6):
        emissivity = [float(10 ** -rng.uniform(0, 2)) for _ in SIDES]
        conditions = []
        for _ in SIDES:
            kind = rng.integers(3)
            if kind == 0:
                conditions.append(("temperature_k", float(rng.uniform(200, 900))))
            elif kind == 1:
                conditions.append(("supplied_w_m2", float(rng.uniform(-20, 200))))
            else:
                conditions.append(("node", "AB"[rng.integers(2)]))
        conditions[int(rng.integers(6))] = ("temperature_k", 400.0)
        supplied_w = {node: float(rng.uniform(-10, 300)) for node in "AB"}
        used = sorted({value for kind, value in conditions if kind == "node"})
        lines = []
        for name, e, (kind, value) in zip(SIDES, emissivity, conditions):
            lines.append(f'[[surface]]\nname = "{name}"\nemissivity = {e!r}\n{kind} = {json.dumps(value)}\n')
        for node in used:
            lines.append(f'[[node]]\nname = "{node}"\nsupplied_w = {supplied_w[node]!r}\n')
        surfaces = solve(rects, f, areas, emissivity, conditions, supplied_w)
        cases.append({"boundary": "".join(lines), "surfaces": surfaces})
    Path(__file__).with_suffix(".json").write_text(json.dumps(cases, indent=1) + "\n")


main()

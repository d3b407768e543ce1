#!/usr/bin/env python3
"""Load form factors that `radiosity form-factors SCENE -o FILE` wrote, and look at them.

    python3 examples/load_form_factors.py F.npz [F.npy F.mtx F.exr F.csv F.vtu ...] [--entry I J]

F[i, j] is the fraction of the light that leaves patch i and reaches patch j, so each row sums to 1 in a closed scene.
Needs numpy and scipy.
"""

import argparse
import csv
import json
import struct
import xml.etree.ElementTree as ElementTree
import zlib

import numpy as np
import scipy.io
import scipy.sparse


def load_npz(path):
    """Returns F (an array or a sparse matrix) and the description; there are more arrays: `area_m2`, `error`, ..."""
    with np.load(path) as archive:
        # Files of older programs have the description as a member that is no array.
        description = json.loads(str(archive["meta"]) if "meta" in archive else archive["meta.json"])
        if "F" in archive:
            return archive["F"], description
    return scipy.sparse.load_npz(path), description


def load_npy(path):
    with open(path + ".json") as beside:
        return np.load(path), json.load(beside)


def load_mtx(path):
    with open(path) as lines:
        next(lines)
        comments = []
        for line in lines:
            if not line.startswith("%"):
                break
            comments.append(line[2:])
    return scipy.io.mmread(path).tocsr(), json.loads("".join(comments))


def load_exr(path):
    """Reads the channel `Y` of a scan-line OpenEXR file with 32-bit floats in blocks of 16 lines, compressed with ZIP."""
    with open(path, "rb") as file:
        data = file.read()
    attributes, at = {}, 8
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 6
        (size,) = struct.unpack_from("<i", data, at - 4)
        attributes[name.decode()] = data[at : at + size]
        at += size
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels, list_at = [], 0
    while attributes["channels"][list_at]:
        name = attributes["channels"][list_at:].split(b"\0", 1)[0]
        channels.append(name.decode())
        list_at += len(name) + 17
    rows = []
    n_blocks = (height + 15) // 16
    for offset in struct.unpack_from(f"<{n_blocks}Q", data, at + 1):
        y, size = struct.unpack_from("<2i", data, offset)
        n_lines = min(16, y1 + 1 - y)
        block = data[offset + 8 : offset + 8 + size]
        if size < 4 * n_lines * width * len(channels):
            # ZIP: bytes are differences, and first all even ones, then all odd ones.
            packed = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
            packed[1:] -= 128
            plain = np.cumsum(packed).astype(np.uint8)
            half = (len(plain) + 1) // 2
            block = np.empty_like(plain)
            block[0::2], block[1::2] = plain[:half], plain[half:]
            block = block.tobytes()
        rows.append(np.frombuffer(block, "<f4").reshape(n_lines, len(channels), width))
    image = np.concatenate(rows)
    return image[:, channels.index("Y")], json.loads(attributes["radiosity"])


def load_csv(path):
    """Returns the form factors between surfaces."""
    with open(path, newline="") as lines:
        lines = list(lines)
    comments = [line[2:] for line in lines if line.startswith("# ")]
    table = list(csv.DictReader(line for line in lines if not line.startswith("# ")))
    names = list(dict.fromkeys(row["from"] for row in table))
    values = np.array([float(row["form_factor"]) for row in table])
    return values.reshape(len(names), len(names)), json.loads("".join(comments))


def load_vtu(path):
    """Returns row sums, in the place of F, and the description."""
    arrays = {array.get("Name"): array for array in ElementTree.parse(path).iter("DataArray")}
    sums = np.array(arrays["row_sum"].text.split(), float)
    description = bytes(int(code) for code in arrays["description"].text.split()[:-1])
    return sums[:, np.newaxis], json.loads(description)


LOADERS = {name[5:]: load for name, load in globals().items() if name.startswith("load_")}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--entry", nargs=2, type=int, metavar=("I", "J"), help="print F[I, J] of every matrix between patches")
    args = parser.parse_args()
    for path in args.files:
        ending = path.rsplit(".", 1)[-1].lower()
        factors, description = LOADERS[ending](path)
        row_sums = np.asarray(factors.sum(axis=1)).ravel()
        least, greatest = float(row_sums.min()), float(row_sums.max())
        print(f"{path}: {description['n_patches']} patches, row sums {least} to {greatest}")
        if ending in ("npz", "npy", "mtx", "exr"):
            n = description["n_patches"]
            assert factors.shape == (n, n)
            if args.entry:
                i, j = args.entry
                print(f"{path}: F[{i}, {j}] = {float(factors[i, j])!r}")
        if ending == "npz":
            check_reciprocity(path, factors, description)


def check_reciprocity(path, factors, description):
    """A_i F_ij = A_j F_ji: to rounding in symmetric form factors, to the noise in others."""
    with np.load(path) as archive:
        area = archive["area_m2" if "area_m2" in archive else "area"]
    exchange = scipy.sparse.diags(area) @ scipy.sparse.csr_array(factors)
    difference = float(abs(exchange - exchange.T).max())
    print(f"{path}: |A_i F_ij - A_j F_ji| is at most {difference} m2")
    if description["symmetric"]:
        assert difference <= 1e-6 * area.max()


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Solve the rows of a design of experiments with CalculiX, two at a time, and write their fields.

    plychain design-of-experiments models/openhole-calculix.json --out doe.csv
    python3 models/calculix/solve.py doe.csv fields

The open-hole plate of models/openhole.json: 200 x 25 mm, a hole of 4 mm, [45, -45, 0]s as one orthotropic sheet (the membrane stiffness of
classical lamination theory), 700 N along y. Needs ccx and nothing else; replace `deck` by your own input file for your own specimen.
"""

import concurrent.futures
import csv
import math
import pathlib
import subprocess
import sys
import tempfile

LENGTH, WIDTH, RADIUS, FORCE = 200.0, 25.0, 2.0, 700.0
LAYUP = [45, -45, 0, 0, -45, 45]
AROUND, RADIAL, ALONG = 16, 16, 14  # elements along a side of the square, from the hole to it, and from it to an end
THICKNESS = 0.78  # mm, where the design has none


def mesh():
    """Q8 nodes and elements: a square about the hole, mapped to it, and a strip to each end."""
    nodes, number, elements, half = [], {}, [], WIDTH / 2

    def node(x, y):
        key = (round(x, 7), round(y, 7))
        if key not in number:
            nodes.append((x, y))
            number[key] = len(nodes)
        return number[key]

    def graded(j, count, power):
        """Way to lattice point j of 2 * count; midside nodes lie in the middle."""
        low, high = (((j + by) / (2 * count)) ** power for by in (-(j % 2), j % 2))
        return (low + high) / 2

    def ring(i, j):
        """Lattice point i of 8 * AROUND about the hole, j of 2 * RADIAL outwards."""
        side, k = divmod(i % (8 * AROUND), 2 * AROUND)
        angle = (side + k / (2 * AROUND)) * math.pi / 2 - math.pi / 4
        c, s = math.cos(angle), math.sin(angle)
        edge = half * (k / AROUND - 1)
        outer = [(half, edge), (-edge, half), (-half, -edge), (edge, -half)][side]
        share = graded(j, RADIAL, 1.6)
        return tuple((1 - share) * RADIUS * a + share * b for a, b in zip((c, s), outer))

    def end(sign, i, j):
        """Lattice point i of 2 * AROUND across, j of 2 * ALONG from the square to an end."""
        share = graded(j, ALONG, 1.3)
        return half * (i / AROUND - 1) * -sign, sign * (half + share * (LENGTH / 2 - half))

    def block(at, across, outwards):
        for i in range(0, 2 * across, 2):
            for j in range(0, 2 * outwards, 2):
                steps = [(0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0)]
                elements.append([node(*at(i + a, j + b)) for a, b in steps])

    block(ring, 4 * AROUND, RADIAL)
    for sign in (1, -1):
        block(lambda i, j: end(sign, i, j), AROUND, ALONG)
    return nodes, elements


def sheet(e1, e2, nu12, g12):
    """Engineering constants E_s, E_t, nu_st, G_st of the laminate as one sheet, s along the load (A12, A16 of a balanced laminate)."""
    low = 1 - nu12 * nu12 * e2 / e1
    q11, q22, q12 = e1 / low, e2 / low, nu12 * e2 / low
    a = [0.0] * 4
    for angle in LAYUP:
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        a[0] += q11 * c**4 + 2 * (q12 + 2 * g12) * c * c * s * s + q22 * s**4
        a[1] += q11 * s**4 + 2 * (q12 + 2 * g12) * c * c * s * s + q22 * c**4
        a[2] += (q11 + q22 - 4 * g12) * c * c * s * s + q12 * (c**4 + s**4)
        a[3] += (q11 + q22 - 2 * q12 - 2 * g12) * c * c * s * s + g12 * (c**4 + s**4)
    a11, a22, a12, a66 = (x / len(LAYUP) for x in a)
    return a11 - a12 * a12 / a22, a22 - a12 * a12 / a11, a12 / a22, a66


def deck(row, nodes, elements):
    """The input file of a row."""
    gpa = [float(row[name]) for name in ("E1_GPa", "E2_GPa", "nu12", "G12_GPa")]
    es, et, nu, g = sheet(*gpa)
    thickness = float(row.get("thickness_mm", THICKNESS))
    # x is t and y is s; nothing contracts through the thickness, which ccx's plane stress, a solid layer, would hinder
    constants = [1e3 * et, 1e3 * es, 1e3 * et, nu * et / es, 0, 0, 1e3 * g, 1e3 * g]
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k},{x:.9f},{y:.9f},0." for k, (x, y) in enumerate(nodes, 1)]
    lines += ["*ELEMENT, TYPE=CPS8, ELSET=SHEET"]
    lines += [f"{k}," + ",".join(map(str, e)) for k, e in enumerate(elements, 1)]
    lines += ["*MATERIAL, NAME=PLIES", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    lines += [",".join(f"{c:.9g}" for c in constants), f"{1e3 * g:.9g},293."]
    lines += ["*SOLID SECTION, ELSET=SHEET, MATERIAL=PLIES", f"{thickness:.9g}"]
    lines += ["*BOUNDARY"]
    held = {}
    for k, (x, y) in enumerate(nodes, 1):
        held[round(x, 6), round(y, 6)] = k
    left, right = held[-WIDTH / 2, 0.0], held[WIDTH / 2, 0.0]
    lines += [f"{left},1,2", f"{right},2,2", "*STEP", "*STATIC", "*CLOAD"]
    for sign in (1, -1):
        share = dict.fromkeys((k for k, (_, y) in enumerate(nodes, 1) if abs(y - sign * LENGTH / 2) < 1e-6), 0.0)
        line = sorted(share, key=lambda k: nodes[k - 1][0])
        for a, m, b in zip(line[0::2], line[1::2], line[2::2]):
            part = FORCE * (nodes[b - 1][0] - nodes[a - 1][0]) / WIDTH
            for k, weight in ((a, 1 / 6), (m, 2 / 3), (b, 1 / 6)):
                share[k] += weight * part
        lines += [f"{k},2,{sign * f:.12g}" for k, f in share.items()]
    lines += ["*NODE PRINT, NSET=ALL", "U", "*END STEP", ""]
    return "\n".join(lines)


def solve(row, nodes, elements, folder):
    """Run ccx on a row and write its field, nodes within 14 mm of the middle."""
    with tempfile.TemporaryDirectory() as place:
        path = pathlib.Path(place) / "row.inp"
        path.write_text(deck(row, nodes, elements))
        subprocess.run(["ccx", "-i", "row"], cwd=place, check=True, stdout=subprocess.DEVNULL)
        answer = {}
        for line in path.with_suffix(".dat").read_text().splitlines():
            words = line.split()
            if len(words) == 4 and words[0].isdigit():
                answer[int(words[0])] = words[1:3]
    with open(folder / f"{row['row']}.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["x_mm", "y_mm", "ux_mm", "uy_mm"])
        for k, (x, y) in enumerate(nodes, 1):
            if abs(y) < 14:
                table.writerow([f"{x:.9f}", f"{y:.9f}", *answer[k]])


def main():
    design, folder = map(pathlib.Path, sys.argv[1:3])
    folder.mkdir(parents=True, exist_ok=True)
    with open(design, newline="") as file:
        rows = list(csv.DictReader(file))
    nodes, elements = mesh()
    missing = [row for row in rows if not (folder / f"{row['row']}.csv").exists()]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        for k, _ in enumerate(pool.map(lambda row: solve(row, nodes, elements, folder), missing), 1):
            print(f"\r{k} of {len(missing)}", end="", flush=True)
    print()


main()

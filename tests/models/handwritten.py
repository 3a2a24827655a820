"""Netlists as people and their scripts write them: every node, element and number in a line of its own."""

from __future__ import annotations

import random

ELECTRICAL = "from std.electrical import capacitor, current, inductor, resistor, voltage\n\n"


def ladder(n: int, *, begun: bool = False) -> str:
    """RC sections in primitive elements, 3 n lines; begun: with a voltage at the start of each capacitor."""
    lines = ["  node v0: electrical", *(f"  node v{k}: electrical" for k in range(1, n + 1))]
    lines.append("  Vs: effort(e = 1 V*sin(2*pi*1000 s^-1*t)) v0 -> ground")
    for k in range(1, n + 1):
        lines.append(f"  R{k}: dissipator(e = {100 + k % 7} ohm*f) v{k - 1} -> v{k}")
        lines.append(f"  C{k}: potential(q = {1 + k % 5} nF*e) v{k} -> ground")
        lines += [f"  init C{k}.e = {k % 3} mV"] * begun
    return _file("", "ladder", lines, f"time 0 s to 20 us; trace v3.e, R2.f, C{n}.q, v{n}.e")


def ladder_of_arrays(n: int) -> str:
    """The same, by `for`."""

    def listed(values: list[str]) -> str:
        rows = [", ".join(values[k : k + 50]) for k in range(0, n, 50)]
        return "[\n    " + ",\n    ".join(rows) + "\n  ]"

    lines = [f"  param R[1..{n}] = {listed([f'{100 + k % 7} ohm' for k in range(1, n + 1)])}"]
    lines += [f"  param C[1..{n}] = {listed([f'{1 + k % 5} nF' for k in range(1, n + 1)])}"]
    lines += [f"  node v[0..{n}]: electrical", "  Vs: effort(e = 1 V*sin(2*pi*1000 s^-1*t)) v[0] -> ground"]
    lines += [f"  for k in 1..{n} {{", "    r[k]: dissipator(e = R[k]*f) v[k - 1] -> v[k]"]
    lines += ["    c[k]: potential(q = C[k]*e) v[k] -> ground", "  }"]
    return _file("", "ladder", lines, f"time 0 s to 20 us; trace v[3].e, r[2].f, c[{n}].q, v[{n}].e")


def mesh(rows: int, columns: int) -> str:
    """A grid of library resistors with a capacitor at each node."""
    lines = [f"  node x{i}_{j}: electrical" for i in range(rows) for j in range(columns)]
    lines.append("  feed: current(i = 1 mA) x0_0 -> ground")
    for i in range(rows):
        for j in range(columns):
            lines.append(f"  C{i}_{j}: capacitor(C = {2 + (i + j) % 3} nF) x{i}_{j} -> ground")
            if j + 1 < columns:
                lines.append(f"  H{i}_{j}: resistor(R = {1 + (i * j) % 4} kohm) x{i}_{j} -> x{i}_{j + 1}")
            if i + 1 < rows:
                lines.append(f"  V{i}_{j}: resistor(R = {2 + (i + 2 * j) % 3} kohm) x{i}_{j} -> x{i + 1}_{j}")
    lines.append(f"  load: resistor(R = 50 ohm) x{rows - 1}_{columns - 1} -> ground")
    last = f"x{rows - 1}_{columns - 1}.e"
    return _file(ELECTRICAL, "mesh", lines, f"time 0 s to 10 us; trace x1_1.e, H1_2.f, V2_1.f, {last}")


def chain(n: int) -> str:
    """Masses, springs and dampers."""
    lines = [f"  node m{k}: translation" for k in range(1, n + 1)]
    lines.append("  push: effort(e = 1 N*sin(3 s^-1*t)) m1 -> ground")
    for k in range(1, n + 1):
        lines.append(f"  M{k}: kinetic(p = {1 + k % 4} kg*f) m{k} -> ground")
        if k < n:
            lines.append(f"  K{k}: potential(e = {100 + k % 9} N/m*q) m{k} -> m{k + 1}")
            lines.append(f"  D{k}: dissipator(e = {1 + k % 2} N.s/m*f) m{k} -> m{k + 1}")
    return _file("", "chain", lines, f"time 0 s to 1 s; trace m2.q, m{n}.f, K3.e, D{n - 1}.f")


def stages(n: int) -> str:
    """Amplifier stages of three nodes each: a coupling capacitor, a bias and a load."""
    lines = ["  node in: electrical", "  source: voltage(v = 10 mV*sin(6283 rad/s*t)) in -> ground"]
    lines += [f"  node {x}{k}: electrical" for k in range(1, n + 1) for x in "abc"]
    for k in range(1, n + 1):
        before = "in" if k == 1 else f"c{k - 1}"
        lines.append(f"  Cc{k}: capacitor(C = {1 + k % 3} uF) {before} -> a{k}")
        lines.append(f"  Rb{k}: resistor(R = {47 + k % 5} kohm) a{k} -> ground")
        lines.append(f"  Rs{k}: resistor(R = {1 + k % 4} kohm) a{k} -> b{k}")
        lines.append(f"  Ci{k}: capacitor(C = {10 + k} pF) b{k} -> ground")
        lines.append(f"  Lo{k}: inductor(L = {1 + k % 2} mH) b{k} -> c{k}")
        lines.append(f"  Ro{k}: resistor(R = {10 + k % 3} kohm) c{k} -> ground")
    return _file(ELECTRICAL, "stages", lines, f"time 0 s to 20 us; trace a2.e, Lo3.f, c{n}.e")


def power_grid(n: int, seed: int = 1) -> str:
    """Buses joined at random: lines with resistance and inductance, loads and generators of their own numbers."""
    draw = random.Random(seed)
    lines = [f"  node bus{k}: electrical" for k in range(n)]
    pairs = [(draw.randrange(k), k) for k in range(1, n)] + [tuple(draw.sample(range(n), 2)) for _ in range(n // 2)]
    for k, (a, b) in enumerate(pairs):
        lines.append(f"  node mid{k}: electrical")
        lines.append(f"  Rl{k}: resistor(R = {draw.uniform(0.1, 0.9):.3f} ohm) bus{a} -> mid{k}")
        lines.append(f"  Ll{k}: inductor(L = {draw.uniform(1, 9):.3f} mH) mid{k} -> bus{b}")
    for k in range(n):
        lines.append(f"  C{k}: capacitor(C = {draw.uniform(1, 9):.3f} uF) bus{k} -> ground")
        if k % 10:
            lines.append(f"  load{k}: resistor(R = {draw.uniform(20, 90):.2f} ohm) bus{k} -> ground")
        else:
            lines.append(f"  G{k}: current(i = {draw.uniform(1, 9):.2f} A*sin(314 rad/s*t + {k} rad)) bus{k} -> ground")
    return _file(ELECTRICAL, "power_grid", lines, f"time 0 s to 5 ms; trace bus3.e, Ll5.f, bus{n - 1}.e")


def mixed(n: int, seed: int = 2) -> str:
    """Nodes joined at random to some of the last twenty: resistors, inductors, diodes, all of different numbers."""
    draw = random.Random(seed)
    lines = [f"  node a{k}: electrical" for k in range(n)]
    lines.append("  feed: voltage(v = 5 V*sin(2*pi*1000 s^-1*t)) a0 -> ground")
    for k in range(n):
        stray = f"capacitor(C = {draw.uniform(1, 9):.4f} nF)" if k else "resistor(R = 1 kohm)"
        lines.append(f"  C{k}: {stray} a{k} -> ground")
        near = range(max(0, k - 20), max(k, 3))
        before = draw.choice(near[: max(k, 1)])
        lines.append(f"  R{k + 1}: resistor(R = {draw.uniform(1, 9):.4f} kohm) a{max(k, 1)} -> a{before}")
        a, b = draw.sample(near, 2)
        if k % 3 == 0:
            lines.append(f"  D{k}: diode(Is = {draw.uniform(1, 9):.3f} pA) a{a} -> a{b}")
        elif k % 3 == 1:
            lines.append(f"  L{k}: inductor(L = {draw.uniform(1, 9):.4f} mH) a{a} -> a{b}")
    head = ELECTRICAL.replace("current, ", "current, diode, ")
    return _file(head, "mixed", lines, f"time 0 s to 1 ms; trace a1.e, L1.f, a{n - 1}.e")


def woven(n: int, seed: int = 3) -> str:
    """Nodes joined at random by a resistor, an inductor and a capacitor in series, told in either sense and any order;
    some start charged; one node in ten has a conductance of another law, and two nodes float.
    """
    draw = random.Random(seed)
    lines = [f"  node a{k}: electrical" for k in range(n)]
    lines.append("  feed: voltage(v = 1 V*sin(2*pi*1000 s^-1*t)) a0 -> ground")
    for k in range(n):
        other = f"a{draw.randrange(k)}" if k else "ground"
        lines.append(f"  C{k}: capacitor(C = {draw.uniform(1, 9):.3f} uF) a{k} -> {draw.choice(['ground', other])}")
        lines.append(f"  R{k}: resistor(R = {draw.uniform(1, 9):.3f} kohm) a{k} -> {other}")
        if k % 10 == 5:
            lines.append(f"  N{k}: dissipator(f = {draw.uniform(1, 9):.3f} uA*sinh(e/(1 V))) a{k} -> ground")
        points = [f"a{k}", f"j{k}", f"k{k}", "ground" if draw.random() < 0.3 else f"a{draw.randrange(n)}"]
        lines += [f"  node j{k}: electrical", f"  node k{k}: electrical"]
        laws = [f"resistor(R = {draw.uniform(10, 90):.2f} ohm)", f"inductor(L = {draw.uniform(1, 9):.3f} mH)"]
        laws.append(f"capacitor(C = {draw.uniform(1, 9):.3f} uF)")
        if draw.random() < 0.5:
            points, laws = points[::-1], laws[::-1]
        placed = [f"  {laws[j][0]}{k}: {laws[j]} {points[j]} -> {points[j + 1]}" for j in range(3)]
        if draw.random() < 0.4:
            placed[1] = f"  {laws[1][0]}{k}: {laws[1]} {points[2]} -> {points[1]}"
        draw.shuffle(placed)
        lines += placed
        lines += [f"  init c{k}.e = {k % 5} mV"] * (k % 3 == 0)
    lines += ["  node x: electrical", "  node y: electrical"]
    lines += ["  X: capacitor(C = 1 uF) x -> y", "  Y: resistor(R = 1 kohm) y -> x", "  init X.e = 1 V"]
    return _file(ELECTRICAL, "woven", lines, f"time 0 s to 1 ms; trace a1.e, j2.e, k3.e, i4.f, c{n - 1}.q, r7.e, Y.f")


def lattice(n: int, seed: int = 4) -> str:
    """Masses joined at random by springs, and by springs and dampers in series, some to a wall, told in any order; some
    move at the start, or are off their springs' rest.
    """
    draw = random.Random(seed)
    lines = [f"  node m{k}: translation" for k in range(n)]
    lines.append("  push: effort(e = 1 N*sin(3 s^-1*t)) m1 -> ground")
    placed = []
    for k in range(n):
        placed.append(f"  M{k}: kinetic(p = {draw.uniform(1, 9):.3f} kg*f) m{k} -> ground")
        other = f"m{draw.randrange(k)}" if k else "ground"
        placed.append(f"  K{k}: potential(e = {draw.uniform(50, 90):.3f} N/m*q) m{k} -> {other}")
        other = draw.choice([f"m{(k + 1 + draw.randrange(n - 1)) % n}", "ground"])
        placed.append(f"  node s{k}: translation")
        placed.append(f"  D{k}: dissipator(e = {draw.uniform(1, 2):.3f} N.s/m*f) m{k} -> s{k}")
        placed.append(f"  S{k}: potential(e = {draw.uniform(5, 9):.3f} N/m*q) s{k} -> {other}")
        placed += [f"  init m{k}.f = {k % 7} mm/s"] * (k % 4 == 0) + [f"  init S{k}.q = {k % 5} mm"] * (k % 5 == 1)
    draw.shuffle(placed)
    return _file("", "lattice", lines + placed, f"time 0 s to 1 s; trace m2.q, m{n - 1}.f, K3.e, D4.f")


def uneven(n: int) -> str:
    """An RC ladder of which no two numbers are equal."""
    draw = random.Random(n)
    lines = ["  node v0: electrical", *(f"  node v{k}: electrical" for k in range(1, n + 1))]
    lines.append("  Vs: voltage(v = 1 V*sin(2*pi*1000 s^-1*t)) v0 -> ground")
    for k in range(1, n + 1):
        lines.append(f"  R{k}: resistor(R = {draw.uniform(100, 200):.6f} ohm) v{k - 1} -> v{k}")
        lines.append(f"  C{k}: capacitor(C = {draw.uniform(1, 5):.6f} nF) v{k} -> ground")
    return _file(ELECTRICAL, "uneven", lines, f"time 0 s to 20 us; trace v3.e, R2.f, C{n}.q, v{n}.e")


def _file(head: str, name: str, lines: list[str], scene: str) -> str:
    return f"{head}model {name} {{\n" + "\n".join(lines) + f"\n}}\n\nscene s of {name} {{ {scene} }}\n"

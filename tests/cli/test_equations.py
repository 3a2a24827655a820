"""`sysdyn equations`: golden texts read against the book, and every simplification against numbers."""

import re

import pytest
from printed_equations import printed
from sysdyn.cli.main import run
from texts import ROOT

GOLDEN = {
    ("pendulum", "lagrangian"): """\
T* = 1/2 m (f1^2 + f2^2)
δW = -m g δq2

            q1' = f1
            q2' = f2
m f1' + 2 q1 κ1 = 0
m f2' + 2 q2 κ1 = -m g
              0 = q1^2 + q2^2 - l^2

κ1 of rod, line 11
""",
    ("pendulum", "hamiltonian"): """\
 T = p1^2/(2 m) + p2^2/(2 m)
δW = -m g δq2

q1' = f1
q2' = f2
p1' = -2 q1 κ1
p2' = -m g - 2 q2 κ1
 f1 = p1/m
 f2 = p2/m
  0 = q1^2 + q2^2 - l^2

κ1 of rod, line 11
""",
    ("em_suspension", "lagrangian"): """\
T* = 1/2 M f_x^2 + b0 f2^2/(2 (b1 + x))
 D = 1/2 R f3^2
δW = (F0 + F1 sin(w t)) δx + E δq3

                  x' = f_x
              M f_x' = -b0 f2^2/(2 (b1 + x)^2) + F0 + F1 sin(w t)
b0 f2'/(b1 + x) + μ1 = b0 f2 f_x/(b1 + x)^2
                  μ1 = R f3 - E
                   0 = f2 - f3

μ1 of series, line 22
""",
    ("pendulum_spring", "lagrangian"): """\
T* = 1/2 m (f1^2 + f2^2)
 V = 1/2 k w^2
 D = 1/2 b f_w^2
δW = -m g δq2

                  q1' = f1
                  q2' = f2
                   w' = f_w
      m f1' + 2 q1 κ1 = 0
m f2' + 2 (q2 - w) κ1 = -m g
        2 (q2 - w) κ1 = b f_w + k w
                    0 = (q2 - w)^2 + q1^2 - l^2

κ1 of rod, line 19
""",
    ("knife_edge", "lagrangian"): """\
T* = 1/2 M (f_x^2 + f_y^2) + 1/2 J f_th^2
δW = sin(al) M g δx

                 x' = f_x
                 y' = f_y
                th' = f_th
M f_x' + sin(th) μ1 = sin(al) M g
M f_y' - cos(th) μ1 = 0
            J f_th' = 0
                  0 = sin(th) f_x - cos(th) f_y

μ1 of edge, line 18
""",
    ("lead_filter", "lagrangian"): """\
 V = q_c^2/(2 C)
 D = 1/2 R1 f_r1^2 + 1/2 R2 f_supply^2
δW = -E sin(w t) δq_supply

q_supply' = f_supply
    q_r1' = f_r1
     q_c' = f_c
       κ1 = -R2 f_supply - E sin(w t)
       κ1 = -R1 f_r1
       κ1 = -q_c/C
        0 = q_c + q_r1 + q_supply - c_out_

κ1 of out_, line 12
""",
    ("co_circuit", "co_lagrangian"): """\
V* = 1/2 C1 e_a^2 + 1/2 C3 e_c^2
 T = (p_a - p_b)^2/(2 L1) + (p_b - p_c)^2/(2 L2)
 G = e_c^2/(2 R3) + e_b^2/(2 R2)
δW = A1 sin(w t) δp_a + A2 δp_c

   p_a' = e_a
   p_b' = e_b
   p_c' = e_c
C1 e_a' = -(p_a - p_b)/L1 + A1 sin(w t)
      0 = -e_b/R2 + (p_a - p_b)/L1 - (p_b - p_c)/L2
C3 e_c' = -e_c/R3 - (p_c - p_b)/L2 + A2
""",
    ("integral_controller", "lagrangian"): """\
T* = 1/2 M f_x^2
 V = 1/2 k x^2
 D = 1/2 b f_x^2
δW = -e δx

    x' = f_x
M f_x' = -e - b f_x - k x
     0 = e - Ki s
    s' = x - qr
""",
}


@pytest.mark.parametrize(("name", "formulation"), GOLDEN)
@pytest.mark.long
def test_equations_are_those_of_the_book(name, formulation, capsys):
    """Examples 6.1, 3.4, 6.6, 2.4.2, 6.4, 5.1 and 2.30, read by eye: rows, signs and classes of efforts."""
    found = printed(capsys, name, "--formulation", formulation)
    assert _same_terms(found, GOLDEN[name, formulation])


BOOK = sorted((ROOT / "tests" / "cli" / "book").glob("*.txt"))


def test_thirteen_systems_in_two_formulations():
    systems = {path.name.split(".")[0] for path in BOOK}
    assert len(systems) == 13
    assert len(BOOK) == 26


@pytest.mark.parametrize("path", BOOK, ids=lambda p: p.stem)
@pytest.mark.long
def test_the_books_systems_are_printed_as_there(path, capsys):
    """Texts read by eye against (6.27), (6.40), Examples 3.1 to 3.4, 4.1, 4.2, 5.1 to 5.4, 6.6, 2.37 and 2.4.2."""
    system, formulation = path.name.split(".")[:2]
    file = ROOT / "models" / "book" / f"{system}.sd"
    assert run(["equations", str(file), "--scene", "reference", "--formulation", formulation, "--quiet"]) == 0
    assert _same_terms(capsys.readouterr().out, path.read_text())


def _same_terms(found, expected):
    """Line by line, up to the order of the energy functions' terms."""
    one, other = found.splitlines(), expected.splitlines()
    assert len(one) == len(other), found
    for a, b in zip(one, other, strict=True):
        left, right = (re.split(r" (?=[+-] )", line.partition("= ")[2]) for line in (a, b))
        assert a.partition("= ")[0] == b.partition("= ")[0], (a, b)
        terms = [sorted(t.removeprefix("+ ").replace("- ", "-") for t in side) for side in (left, right)]
        assert terms[0] == terms[1], (a, b)
    return True


@pytest.mark.long
def test_the_arm_has_the_terms_of_the_book(capsys):
    """Example 3.1: squares of sines and cosines joined, differences of angles, like terms: four terms a row."""
    found = printed(capsys, "two_link_arm", "--formulation", "lagrangian")
    rows = [line.strip() for line in found.splitlines() if "f_th1'" in line and line.strip() != "th1' = f_th1"]
    first, second = rows
    assert first == (
        "(m1 + m2) l1^2 f_th1' + m2 l1 l2 cos(th1 - th2) f_th2'"
        " = -m2 l1 l2 sin(th1 - th2) f_th2^2 - (m1 + m2) l1 g cos(th1) - l1 F3 sin(th1) sin(w t)"
    )
    assert second == (
        "m2 l1 l2 cos(th1 - th2) f_th1' + m2 l2^2 f_th2'"
        " = m2 l1 l2 sin(th1 - th2) f_th1^2 - m2 l2 g cos(th2) - l2 F3 sin(th2) sin(w t)"
    )


def test_the_canonical_suspension_has_the_row_of_the_book(capsys):
    """(4.22): the pull of the magnet is p2^2/(2 b0), whatever the gap."""
    found = printed(capsys, "em_suspension", "--form", "canonical", "--formulation", "hamiltonian")
    assert "p_x' = -p2^2/(2 b0) + F0 + F1 sin(w t)" in found
    assert "H = (b1 + x) p2^2/(2 b0) + p_x^2/(2 M)" in found


def test_matrices_by_name(capsys):
    assert (
        printed(capsys, "pendulum", "--form", "matrices")
        == """\
  M = [ m   0 ]
      [ 0   m ]
Φ_q = [ 2 q1   2 q2 ]
  Y = [ 0    ]
      [ -m g ]
 Z1 = [ 2 f1^2 + 2 f2^2 ]

f = (f1, f2)

degrees of freedom: n - m1 - m2 = 2 - 1 - 0 = 1, where the constraints are independent
index by structure: 3
  rate of q1: differentiated once
  rate of q2: differentiated once
  displacement constraint rod: differentiated twice
  all once more for the rates of what has none yet: κ of rod
"""
    )


def test_latex(capsys):
    found = printed(capsys, "pendulum", "--latex", "--formulation", "hamiltonian")
    assert r"\dot p_{2} &= -m \, g - 2 \, q_{2} \, \kappa_{1}" in found
    assert found.count(r"\begin{align*}") == found.count(r"\end{align*}") == 2


def test_a_page(capsys):
    found = printed(capsys, "pendulum", "--html")
    assert found.startswith("<!doctype html>")
    assert found.count("<math>") == found.count("</math>") == 5  # two functions, three rows

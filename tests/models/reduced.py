"""The seed's reduced ODEs, integrated by SciPy: a witness that shares nothing with the compiler.

Right sides come as strings in Python syntax; they are read with `ast` and turned into closures, never evaluated.
"""

import ast
import operator
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

ROOT = Path(__file__).resolve().parents[2]


def lambert(z):
    """y with y exp(y) = exp(z): Newton on log(y) + y = z, exact to rounding for any z."""
    y = np.exp(z) if z < -2.0 else 1.0 if z < 2.0 else z - np.log(z)
    for _ in range(60):
        step = (y + np.log(y) - z) / (1.0 + 1.0 / y)
        y = y - step if step < y else 0.5 * y
        if abs(step) <= 1e-16 * y:
            break
    return y


_BINARY = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_CALLS = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "Abs": abs,
    "sqs": lambda z: np.sign(z) * np.sqrt(abs(z)),
    "lamw": lambert,
}


def closure(text):
    """names -> number, of a string in Python syntax."""
    return _closure(ast.parse(text, mode="eval").body)


def _closure(node):
    match node:
        case ast.BinOp():
            function, left, right = _BINARY[type(node.op)], _closure(node.left), _closure(node.right)
            return lambda names: function(left(names), right(names))
        case ast.UnaryOp(op=ast.USub()):
            inner = _closure(node.operand)
            return lambda names: -inner(names)
        case ast.Constant(value=int() | float()):
            number = float(node.value)
            return lambda names: number
        case ast.Name():
            name = node.id
            return lambda names: names[name]
        case ast.Call(func=ast.Name(), keywords=[]):
            function, inner = _CALLS[node.func.id], [_closure(a) for a in node.args]
            return lambda names: function(*(a(names) for a in inner))
    raise AssertionError(ast.dump(node))


def in_order(texts, known):
    """Auxiliary definitions, each after those that it reads."""
    uses = {k: {n.id for n in ast.walk(ast.parse(v)) if isinstance(n, ast.Name)} & set(texts) for k, v in texts.items()}
    done = []
    while len(done) < len(texts):
        ready = [k for k in texts if k not in done and uses[k] <= set(done)]
        assert ready, f"a circle among {sorted(set(texts) - set(done))} over {sorted(known)}"
        done += ready
    return [(k, closure(texts[k])) for k in done]


def solution(ode, parameters, initial, times, method="DOP853", rtol=1e-12):
    """{variable: values [times]} of a reduced ODE; state scaled by nothing, atol far below what is compared."""
    states = list(ode["rhs"])
    right = [closure(ode["rhs"][s]) for s in states]
    aux = in_order(ode["aux"], parameters)

    def names_at(t, y):
        names = {**parameters, "t": t, **dict(zip(states, y, strict=True))}
        for name, function in aux:
            names[name] = function(names)
        return names

    def rhs(t, y):
        names = names_at(t, y)
        return [function(names) for function in right]

    start = [initial[s] for s in states]
    times = np.asarray(times)
    found = solve_ivp(rhs, (0.0, times[-1]), start, method=method, t_eval=times, rtol=rtol, atol=rtol * 1e-3)
    assert found.success, found.message
    out = {name: closure(text) for name, text in ode["out"].items()}
    rows = [names_at(t, y) for t, y in zip(times, found.y.T, strict=True)]
    return {name: np.array([float(function(names)) for names in rows]) for name, function in out.items()}

"""Models that no check can fault and that stop at run time: what the finding must say, and where."""

from typing import NamedTuple


class Stop(NamedTuple):
    """A text that stops; code; mark: on the line of the finding; said: in message; remedy: in the help."""

    text: str
    code: str
    mark: str
    said: tuple[str, ...]
    remedy: str


def model(body, time="10 s"):
    """A model of these statements with a scene that traces x."""
    lines = "".join(f"  {line}\n" for line in body)
    return f"model m {{\n{lines}}}\n\nscene s of m {{\n  time 0 s to {time}\n  trace x\n}}\n"


CART = ["coord x: translation = 0.1 m", "energy T* = 1/2*(1 kg)*x'^2", "init x' = 0 m/s"]
STOPS = {
    "a root below zero": Stop(
        model(["state x: m = 1 m", "dynamic x' = -(0.02 m/s)*sqrt(x/(1 m)) - 0.01 m/s"], "100 s"),
        "E933",
        "dynamic",
        ("sqrt(x/(1 m)) is no number", " m"),
        "last good state at",
    ),
    "a pipe that runs dry": Stop(
        "from std.fluid import tank\n"
        + model(
            [
                "node a: hydraulic",
                "T: tank(A = 0.1 m^2) a = a",
                "V: dissipator(f = 1e-4 m^3/s*sqrt(e/(1 kPa))) a -> ground",
                "P: flow(f = 1e-4 m^3/s) a -> ground",
                "init T.store.q = 0.02 m^3",
            ],
            "600 s",
        ).replace("trace x", "trace a.e"),
        "E933",
        "V: dissipator",
        ("sqrt(e/(1 kPa)) is no number", "V.e = ", " Pa"),
        "T.store.q = ",
    ),
    "a table that ends": Stop(
        "table curve(i: m) -> N linear stop [\n  (0, 0), (1, 2), (3, 4)\n]\n"
        + model([*CART, "work 5 N - curve(x) on x"]),
        "E932",
        "work 5 N",
        ("table curve", "x = 3 m"),
        "'clamp' or 'extend'",
    ),
    "a state that grows without bound": Stop(
        model(["state x: 1 = 1", "dynamic x' = x^2/(1 s)"]),
        "E930",
        "dynamic",
        ("unknown x", "grows without bound"),
        "in bounds",
    ),
    "a spring that pushes away": Stop(
        model([*CART, "energy V = -1/4*(10 kN/m^3)*x^4"]),
        "E930",
        "energy V",
        ("unknown x'", "grows without bound", "m/s"),
        "an energy with a minimum",
    ),
    "a gas that is pressed to nothing": Stop(
        model([*CART, "work -3 N on x", "energy V = (0.3 J)*ln(x/(1 m))"]),
        "E930",
        "energy V",
        ("goes to zero", "x = ", " m"),
        "x' = ",
    ),
    "a mechanism at its dead centre": Stop(
        model(
            [
                "coord x: translation ~ 0.3 m",
                "coord y: translation ~ 1 m",
                "energy T* = 1/2*(1 kg)*(x'^2 + y'^2)",
                "phi bar: x*y = (0.5 m)^2",
                "phi line: x + y = 1.2 m - 0.1 m/s*t",
            ]
        ),
        "E931",
        "phi line",
        ("bar, line lose their rank", "at t = 2 s"),
        "dead centre",
    ),
    "a limit of steps": Stop(
        model([*CART, "energy V = 1/2*(100 N/m)*x^2"], "1000 s").replace("trace x", "trace x\n  limit steps 50"),
        "E934",
        "limit steps",
        ("the limit of steps",),
        "a higher limit",
    ),
}

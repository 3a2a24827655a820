"""Components that `std.electrical` lacks, as texts written beside a model."""

from __future__ import annotations

LOCAL = {
    "nmos": """## Field-effect transistor of n channel, level 1 (Shichman and Hodges), without capacitances.
component nmos {
  ## transconductance times width over length, threshold, modulation of the channel's length
  param beta: A/V^2
  param vto: V
  param lambda: V^-1
  port d, g, s: electrical
  let forward = max(g.e - s.e - vto, 0 V)
  let backward = max(g.e - d.e - vto, 0 V)
  channel: dissipator(f = 1/2*beta*(forward^2 - backward^2)*(1 + lambda*abs(d.e - s.e))) d -> s
}
""",
    "pmos": """## Field-effect transistor of p channel, level 1 (Shichman and Hodges), without capacitances.
component pmos {
  ## transconductance times width over length, threshold (negative), modulation of the channel's length
  param beta: A/V^2
  param vto: V
  param lambda: V^-1
  port d, g, s: electrical
  let forward = max(s.e - g.e + vto, 0 V)
  let backward = max(d.e - g.e + vto, 0 V)
  channel: dissipator(f = 1/2*beta*(forward^2 - backward^2)*(1 + lambda*abs(d.e - s.e))) s -> d
}
""",
    "pnp": """## Bipolar transistor of the other polarity after Ebers and Moll, without junction capacitances.
component pnp {
  param Ies = 1e-14 A
  param Ics = 2e-14 A
  param aF = 0.99
  param aR = 0.495
  param vT = 25.85 mV
  port c, b, e: electrical
  let iF = Ies*(exp((e.e - b.e)/vT) - 1)
  let iR = Ics*(exp((c.e - b.e)/vT) - 1)
  seb: dissipator(f = iF - aR*iR) e -> b
  scb: dissipator(f = iR - aF*iF) c -> b
}
""",
    "piecewise_current": """## A current along straight lines through n points, constant outside of them.
component piecewise_current {
  param n: 1
  ## ascending instants, and the current at each
  param at[1..n]: s
  param i[1..n]: A
  branch: electrical
  law f = i[1] + sum(k in 2..n: (i[k] - i[k-1])*clip((t - at[k-1])/(at[k] - at[k-1]), 0, 1))
  require n >= 2
}
""",
}
"""By name; bodies are those of models after SPICE."""

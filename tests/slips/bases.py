"""Right models that the slips are made in: each passes `check` without a finding, and runs."""

BASES = {
    "cart": """## A cart on a spring.
model cart {
  param m = 2 kg
  param k = 80 N/m
  param d = 3 N.s/m
  input push: N = 0 N
  coord x: translation = 0.1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2
  content D = 1/2*d*x'^2
  work push on x
  init x' = 0 m/s
}

scene free of cart {
  time 0 s to 2 s
  set push = 1 N
  trace x in mm, x' as v every 10 ms
  expect always: abs(audit.energy) <= 1 mJ
}
""",
    "filter": """from std.electrical import resistor, capacitor, voltage

model filter {
  param R1 = 1 kohm
  param C1 = 100 nF
  node a, b: electrical
  Vs: voltage(v = 5 V*sin(2*pi*50 Hz*t)) a -> ground
  Ra: resistor(R = R1) a -> b
  Cb: capacitor(C = C1) b -> ground
  Rb: resistor(R = 10 kohm) b -> ground
  init Cb.e = 0 V
}

scene tone of filter {
  time 0 s to 20 ms
  trace b.e as out, Ra.f in mA every 100 us
}
""",
    "pendulum": """model pendulum {
  param m = 1 kg
  param l = 2 m
  coord x: translation = 0.5 m
  coord y: translation ~ -2 m
  energy T* = 1/2*m*(x'^2 + y'^2)
  energy V = m*g0*y
  phi rod: x^2 + y^2 = l^2
  init x' = 0 m/s
}

scene swing of pendulum {
  time 0 s to 1 s
  trace x, y, rod.on(y) as pull
}
""",
    "drive": """from std.electrical import voltage
from std.mechanical import inertia, rotary_damper, gear
from std.transduce import dc_motor

model drive {
  param U = 24 V
  param n = 5
  node a: electrical
  node shaft, load: rotation
  S: voltage(v = U) a -> ground
  M: dc_motor(R = 1 ohm, L = 1 mH, K = 0.05 V.s/rad, J = 1 g.m^2, b = 1e-5 N.m.s/rad) p = a, n = ground, shaft = shaft
  J: inertia(J = 0.001 kg.m^2) shaft
  G: gear(ratio = n) inp = shaft, out = load
  b: rotary_damper(b = 0.1 N.m.s/rad) load -> ground
  init shaft.f = 0 rad/s
  init M.La.f = 0 A
}

scene go of drive {
  time 0 s to 0.5 s
  trace shaft.f in rpm as speed, M.La.f as current every 1 ms
  expect finally: load.f >= 0 rad/s
}
""",
    "tanks": """from std.fluid import tank, valve
from std.thermal import capacity, conductance, temperature

model tanks {
  param A = 0.5 m^2
  node left, right: hydraulic
  node water, room: heat
  T1: tank(A = A) a = left
  T2: tank(A = A) a = right
  R: dissipator(e = 1e6 Pa.s/m^3*f) left -> right
  c: capacity(C = 4 kJ/K) water
  wall: conductance(G = 8 W/K) water -> room
  air: temperature(T = celsius(20)) room -> ground
  init T1.store.q = 0.8 m^3
  init T2.store.q = 0.1 m^3
  init c.e = celsius(60)
}

scene level_out of tanks {
  time 0 s to 10 min
  trace T1.store.q, T2.store.q, water.e in degC as temperature every 1 s
}
""",
    "line": """from std.electrical import capacitor, inductor, resistor, voltage

model line {
  param n = 6
  param C0 = 100 pF
  node v[0..n]: electrical
  V: voltage(v = 1 V*min(t/(1 us), 1)) v[0] -> ground
  for i in 1..n {
    L[i]: inductor(L = 1 uH) v[i - 1] -> v[i]
    C[i]: capacitor(C = C0) v[i] -> ground
  }
  R: resistor(R = 100 ohm) v[n] -> ground
}

scene edge of line {
  time 0 s to 1 us
  trace v[n].e as far
}
""",
    "oven": """from std.control import pid

model oven {
  param C = 5 kJ/K
  param G = 3 W/K
  input target: K = celsius(60)
  state T: K = celsius(20)
  discrete on = false
  let err = target - T
  P: pid(kp = 40 W/K, ki = 0.1 W/K/s, lo = 0 W, hi = 800 W) r = target, y = T
  let gain = if on then 1 else 0.5
  dynamic T' = (gain*P.u - G*(T - celsius(20)))/C
  when T >= celsius(50) { on := true }
  every 1 min { on := false }
}

scene heat_up of oven {
  time 0 s to 5 min
  trace T in degC, P.u as power, err every 1 s
  accuracy 1e-5 on T
}
""",
    "parts": """## A battery in two depths.
component battery {
  param U = 12 V
  param R = 50 mohm
  port p, n: electrical
  level ideal default {
    s: effort(e = U) p -> n
  }
  level real {
    node m: electrical
    s: effort(e = U) m -> n
    Ri: dissipator(e = R*f) p -> m
  }
}

component lamp {
  param R: ohm
  branch: electrical
  law e = R*f
  require R > 0 ohm
}

fn square(u: 1) -> 1 = u^2

table curve(i: A) -> V linear clamp [
  (0, 0), (1, 2), (3, 4)
]

model light {
  node a: electrical
  B: battery() p = a, n = ground
  L: lamp(R = 6 ohm*square(1)) a -> ground
  let drop = curve(L.f)
}

scene plain of light {
  time 0 s to 1 s
  level B = real
  set B.U = 6 V
  trace a.e, L.f in mA, drop
}
""",
    "ball": """model ball {
  param m = 0.2 kg
  param mu = 0.3
  input pull: N = 0 N
  coord h: translation = 1 m
  coord s: translation = 0 m
  energy T* = 1/2*m*(h'^2 + s'^2)
  energy V = m*g0*h
  content D = mu*m*g0*abs(s')
  work pull on s
  phi floor: h >= 0 m restitution 0.7
  init h' = 0 m/s
  init s' = 1 m/s
}

scene drop of ball {
  time 0 s to 1 s
  trace h, s every 10 ms
}
""",
    "road": """## A quarter car over a bump.
table bump(x: m) -> mm linear clamp [
  (0, 0), (1, 0), (1.2, 60), (1.8, 60), (2, 0)
]

model quarter_car {
  param ms = 300 kg
  param mu = 40 kg
  param ks = 18 kN/m
  param kt = 180 kN/m
  param c = 1.2 kN.s/m
  param v = 5 m/s
  let road = bump(v*t)
  coord zs, zu: translation
  energy T* = 1/2*ms*zs'^2 + 1/2*mu*zu'^2
  energy V = 1/2*ks*(zs - zu)^2 + 1/2*kt*(zu - road)^2
  content D = 1/2*c*(zs' - zu')^2
  init zs = 0 m
  init zu = 0 m
  init zs' = 0 m/s
  init zu' = 0 m/s
}

scene drive of quarter_car {
  time 0 s to 1 s
  trace zs in mm, zu in mm, kt*(zu - road) in kN as tyre every 5 ms
}
""",
    "arm": """model arm {
  param m = 1 kg
  param l = 0.5 m
  param kp = 20 N.m/rad
  coord th: rotation = 30 deg
  coord ph: rotation = 0
  let px = l*sin(th) + l*sin(ph)
  let py = -l*cos(th) - l*cos(ph)
  energy T* = 1/2*m*(px'^2 + py'^2) + 1/2*(0.1 kg.m^2)*(th'^2 + ph'^2)
  energy V = m*g0*py
  work -kp*th - (2 N.m.s/rad)*th' on th
  init th' = 0 rad/s
  init ph' = 0 rad/s
}

scene hold of arm {
  time 0 s to 1 s
  trace th in deg, ph in deg every 10 ms
}
""",
}

"""Other parameters and initial values of the seed's models: `x_0` is the initial value of x.

Moduli between 0.4 and 1.8 of the book's, other signs where the equations keep their sense (negative stiffness,
negative ratios), starts elsewhere.
"""

CHANGED = {
    "bead_rod": [
        {"w0": 1.1, "g": 9.81, "rho_0": 0.5},
        {"M": 0.9, "w0": -0.5, "c": -0.1, "v_0": -0.4},
        {"w0": 0.42, "g": 3.7, "rho_0": -0.2, "v_0": 0.6},
    ],
    "coulomb_planar": [  # friction has its law only while the particle moves
        {"M": 1.3, "mu": 0.2},
        {"mu": 0.4, "g": 3.7, "x_0": 0.5},
        {"M": 2.6, "mu": 0.25, "y_0": -0.4},
    ],
    "diode_circuit": [
        {"E": 3.5, "Rs": 17.0, "C": 1.2e-5},
        {"w": 200.0, "RL": 600.0, "a": 34.0, "v_0": 1.0},
        {"Is": 1.6e-9, "E": 8.0, "v_0": 2.0, "QL_0": 1e-3},
    ],
    "em_suspension": [
        {"M": 3.1, "x_0": 0.001, "F1": 0.6},
        {"b0": 0.0052, "R": 4.0, "i_0": 0.8},
        {"w": 33.0, "E": 4.0, "v_0": 0.02, "b1": 0.013, "F0": 15.0},
    ],
    "fluid_tank": [
        {"Q10": 0.8, "w": 1.6},
        {"R": 3.2, "C": 0.9, "V_0": 2.5},
        {"Q10": -0.3, "w": 0.6, "V_0": -0.4},
    ],
    "integral_controller": [
        {"M": 1.6, "k": 2.0},
        {"b": 3.2, "Ki": 0.9, "x_0": 0.4, "v_0": -1.0},
        {"k": -0.5, "b": 1.5, "Ki": 0.3, "qr": -0.7, "s_0": 0.2},
    ],
    "knife_edge": [
        {"M": 1.3, "al": 0.5, "om_0": 1.4},
        {"J": 0.25, "g": 3.7, "th_0": -1.0, "v_0": -0.6},
        {"al": -0.2, "th_0": 1.5, "om_0": -2.5, "x_0": 0.3, "y_0": -1.0},
    ],
    "lcr_nonlinear": [
        {"L1": 0.8, "k": 0.5},
        {"C": 0.06, "R2": 4.8, "E": 6.0, "i_0": 1.0},
        {"w": 9.0, "v_0": -2.0, "R2": 1.9, "i_0": -0.5},
    ],
    "lead_filter": [
        {"R1": 1600.0, "C": 6e-5},
        {"R2": 410.0, "E": 2.0, "v_0": 0.5},
        {"w": 20.0, "R1": 620.0, "v_0": -0.3, "Q1_0": 1e-4},
    ],
    "lever": [
        {"be": 0.9, "k": 8.0},
        {"be": -1.2, "m1": 1.3, "x1_0": -0.1, "v1_0": 0.5},
        {"k": -0.2, "b": 0.65, "w": 3.2, "F0": 1.6, "m2": 0.6},
    ],
    "mass_spring": [
        {"M": 3.3, "k": 5.0},
        {"x_0": -0.8, "v_0": 0.3, "k": 13.0},
        {"k": -0.4, "M": 1.3},
    ],
    "nonlinear_fluid": [
        {"Cr1": 2.8e6, "Ps": 1.4e6},
        {"Cr2": 6.5e6, "Cf": 2.1e-6},
        {"V_0": 2.9, "Cr1": 6.4e6, "Cr2": 3.0e6, "Ps": 7e5},
    ],
    "nonlinear_spring": [
        {"k1": -1.0, "x_0": 1.5},
        {"m": 1.7, "k3": 1.2, "v_0": -1.0},
        {"k1": -1.6, "k3": 3.4, "b": 0.3, "x_0": 0.05},
    ],
    "parallelogram": [
        {"l": 1.6, "d": 0.9},
        {"mb": 0.6, "g": 3.7, "th_0": -1.2},
        {"th_0": 0.2, "om_0": 1.9, "d": 2.4},
    ],
    "pendulum": [
        {"l": 0.9, "th_0": 1.9},
        {"m": 0.7, "g": 3.7, "om_0": 2.5},
        {"l": 3.9, "th_0": -2.8, "om_0": -0.6},
    ],
    "pendulum_spring": [
        {"m": 1.3, "k": 24.0},
        {"l": 2.5, "b": 1.7, "th_0": -0.7, "om_0": 0.4},
        {"g": 3.7, "w_0": 0.2, "z_0": -0.5, "k": 9.0},
    ],
    "pi_controller": [
        {"Kp": 6.5, "Ki": 3.3},
        {"k": -0.8, "M": 1.7, "x_0": 0.5},
        {"b": 1.3, "qr": -1.6, "v_0": 0.7, "s_0": -0.3},
    ],
    "rectifier_motor_crank": [
        {"E": 14.0, "J": 0.033, "v_0": 6.0},
        {"w": 220.0, "C": 0.006, "R": 2.4, "M": 0.65},
        {"r": 0.08, "l": 0.17, "th_0": 1.4, "om_0": 5.0, "a": 7.0},
    ],
    "relativistic_mass": [
        {"F": 3.4, "c": 1.9},
        {"m": 0.95, "p_0": -4.0},
        {"c": 4.8, "F": -1.2, "x_0": 2.0, "p_0": 3.0},
    ],
    "slider_crank": [
        {"m1": 0.6, "l": 1.3, "th_0": 2.5},
        {"b": 0.4, "tau": 1.5, "om_0": -1.0},
        {"r": 0.65, "m2": 1.3, "th_0": -0.4, "om_0": 3.4, "tau": -0.5},
    ],
    "solenoid": [
        {"M": 0.16, "k": 90.0},
        {"E": 8.0, "R": 6.0, "b": 1.3, "i_0": 0.5},
        {"L0": 0.08, "L1": 0.2, "d": 0.03, "x_0": -0.01, "v_0": 0.2},
    ],
    "two_link_arm": [
        {"m1": 0.75, "l2": 1.1, "a_0": -1.2, "c_0": -1.8},
        {"g": 3.7, "F3": 1.2, "wa_0": 1.0},
        {"l1": 1.6, "m2": 0.5, "w": 4.5, "a_0": -1.6, "c_0": -1.4, "wc_0": -1.5},
    ],
}
"""Model -> sets of changed values."""

STIFF = {"diode_circuit": ("Radau", 1e-10), "rectifier_motor_crank": ("LSODA", 1e-11)}
"""Methods and tolerances of the witness where DOP853 would take too many steps."""

EXTREME = {
    "dc_motor": [{"R": 0.0, "b": 0.0, "be": -0.25}],
    "electrical_transformer": [{"L1": 0.0}, {"L2": 0.0, "be": -2.0}, {"R1": 0.0, "R2": 0.0}],
    "fluid_transformer": [{"R": 0.0, "be": -1.8}],
    "gear_pair": [{"J1": 0.0}, {"J2": 0.0, "be": -0.4}, {"b": 0.0}],
    "lcr_nonlinear": [{"k": 0.0}],
    "lever": [{"m1": 0.0}, {"m2": 0.0, "be": -1.5}, {"k": -0.5, "b": 0.0}],
    "mass_spring": [{"k": 0.0}],
    "mechanical_gyrator": [{"be": 0.0}],
    "nonlinear_spring": [{"k1": 0.0, "b": 0.0}, {"k3": 0.0, "k1": -0.3}],
    "pd_pump": [{"b": 0.0, "be": -0.5}],
    "pendulum_spring": [{"b": 0.0, "k": 30.0}],
    "rack_pinion": [{"J": 0.0}, {"m": 0.0, "be": -0.15}, {"k": -10.0, "b": 0.0}],
    "ram_cylinder": [{"m": 0.0}, {"I1": 0.0, "A": -0.8}, {"k": -5.0, "R": 0.0, "b": 0.0}],
    "rectifier_motor_crank": [{"M": 0.0}, {"b": 0.0, "J": 0.04}],
    "redundant_pendulum": [{"l": 2.0, "om_0": 3.0}],
    "rolling_disk": [{"M": 0.0}],
    "slider_crank": [{"m2": 0.0, "b": 0.4, "tau": 1.5}, {"m2": 0.0, "l": -2.0}],
    "solenoid": [{"b": 0.0, "k": 0.0}],
    "two_link_arm": [{"F3": 0.0, "m1": 0.01}],
    "two_tank": [{"F0": -0.5}],
    "voice_coil": [{"be": -5.0, "b": 0.0}, {"k": -1.0, "R": 0.0}],
}
"""Moduli of zero and of the other sign: no inertia, no stiffness, no loss, a ratio that turns round."""

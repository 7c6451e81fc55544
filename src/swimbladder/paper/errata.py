"""Where the paper's text is wrong or silent, and what is done about it here.

docs/explanation/errata.md is the home of this list; a test holds the two together.
"""

from __future__ import annotations

from typing import NamedTuple


class Erratum(NamedTuple):
    """A place in the paper, what stands there, and what is right."""

    where: str
    printed: str
    right: str


ERRATA = (
    Erratum(
        "Eq. (2)",
        "-dp/beta_e = 0.6 % for 10 MPa on 1.5 GPa.",
        "The numbers give -0.67 %: the sign is lost on the way and the last digit cut off.",
    ),
    Erratum(
        "Eq. (4)",
        "Q_l = k_pl rho g_2/n_h.",
        "rho g z: without the depth, (5) and (6) would not follow.",
    ),
    Erratum(
        "Eq. (7), Table 1",
        "The load torque is divided by the efficiency, whichever way the motor turns.",
        "Right while the motor drives against the sea. When the sea drives the motor back the "
        "torque is multiplied by the efficiency; divided, more work would reach the motor than the "
        "sea does. The passive form is the default where an efficiency is known; the literal form "
        "is there on request.",
    ),
    Erratum(
        "Eq. (16)",
        "The drag is turbulent if dz/dt > epsilon.",
        "|dz/dt| must be tested, or a rising vehicle has laminar drag at any speed. The form also "
        "jumps at epsilon unless k_dl = k_dt epsilon: the default joins the two branches, the "
        "literal form is there on request.",
    ),
    Erratum("Eq. (22)", "T stands for the time constant.", "It is T1, as in (24)."),
    Erratum(
        "Section 2.3",
        "In shallow water the depth load T_z may be left out.",
        "While the motor drives, yes. In (33), where nothing locks the piston, 0 V let the sea "
        "push it in: at 3.75 m by 1 cm3 a second, against steps of 20 to 75 cm3. After a timed "
        "voltage the piston is held here by the voltage k_z/k_u z.",
    ),
    Erratum(
        "Section 2.3",
        "In shallow water the compressibility F_def may be left out.",
        "Over 3 m psi = 4.04e-6 m3/m changes the neutral volume by 12 cm3, against a smallest step "
        "of 20 cm3. Fits without psi find K2 and T2 up to twice too large, the more so the smaller "
        "the step; only their ratio rho g/m survives.",
    ),
    Erratum(
        "Section 3",
        "An outer radius of 200 mm.",
        "It is the diameter: the printed psi follows from a cylinder of 0.1 m radius, 1285 mm "
        "long.",
    ),
    Erratum(
        "Section 3",
        "A depth of 100 m with a volume change of +-350 cm3.",
        "With the printed psi the neutral volume at 100 m is 404 cm3: trimmed neutral at the "
        "surface in mid-stroke, the vehicle can hold a depth down to 86.6 m.",
    ),
    Erratum(
        "Section 3.1, step (b)",
        "After the increase of buoyancy, wait until the vehicle reaches the bottom.",
        "It rises: step (b) ends at the surface.",
    ),
    Erratum(
        "Section 3.1",
        "(26) is fitted from V to z, and (21) from V to dz/dt.",
        "(26) is V to dz/dt, (27) is V to z; (21) is the actuator.",
    ),
    Erratum(
        "Table 2",
        "K = -7935.54 and -7634.95.",
        "K is the gain of the transfer function, -K2; K2 itself is positive.",
    ),
    Erratum(
        "Section 3.2",
        "psi = 0.01 V_p/100 = 4.04e-6 m3/m with V_p = 0.0275 m3.",
        "The formula gives 2.75e-6 m3/m. The printed value is that of the outer cylinder's 40.4 "
        "dm3. The printed value is used.",
    ),
)

SILENT = (
    Erratum("Piston area A", "Not printed; the pairs of dx and dV give 75 to 80 cm2.", "75 cm2."),
    Erratum("Supply", "Not printed; a battery.", "A limit of 12 V."),
    Erratum("Water", "Neither density nor gravity are printed.", "1000 kg/m3 and 9.80665 m/s2."),
    Erratum(
        "Eqs (36)-(37), start",
        "U_i(0) and e(-1) are not stated.",
        "U_i(0) is the volume at the start and e(-1) = e(0). U_i(0) = 0 would shift the depths by "
        "up to 5 cm.",
    ),
    Erratum(
        "Computation delay",
        "Not stated. One whole sample of it would make the printed loop unstable.",
        "None.",
    ),
    Erratum(
        "Sensors",
        "Neither noise nor resolution are stated.",
        "None, except in the pool procedure: 2 mm of white noise and steps of 5 mm in depth, steps "
        "of 0.1 mm of the piston.",
    ),
    Erratum(
        "Figs 12-14, 16, 17",
        "Set-points and measured curves stand in the figures only.",
        "Set-points of our own between 0.5 and 4 m; no measured curve is drawn.",
    ),
    Erratum(
        "Section 3.1, Delta_z, the voltage and the end of step (a)",
        "Not stated.",
        "Delta_z = 0.75 m; the largest voltage up to 12 V that makes dt a whole number of samples; "
        "a mean speed below 0.5 mm/s over a minute.",
    ),
)

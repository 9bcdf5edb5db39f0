"""The numbers that the Pioneer paper prints.

B. Innocenti, P. Ridao, N. Gascons, A. El-Fakdi, B. Lopez, J. Salvi, "Dynamical model parameters identification of a
wheeled mobile robot", section 4: Tables 3-5 and figure 4.
"""

from types import MappingProxyType

TABLE_3 = MappingProxyType(
    {
        "1/a11": (17.83, 16.49, 16.89, 17.07),
        "Cv": (0.0441, 0.0445, 0.0446, 0.0444),
        "Cs": (0.3349, 0.3287, 0.2921, 0.3186),
    }
)
"""Straight motion: symbol -> (experiments 1, 2 and 3, mean) [kg; N m s; N m]; inputs PRBS, PRBS, STEP."""

TABLE_4 = MappingProxyType(
    {
        "1/a22": (0.4301, 0.4127, 0.4292, 0.424),
        "Cv1": (0.000429, 0.000389, 0.000469, 0.000429),
        "Cs1": (0.004535, 0.004532, 0.004541, 0.004536),
    }
)
"""Turning on the spot: symbol -> (experiments 1, 2 and 3, mean) [kg m^2; N m s; N m]; inputs STEP, PRBS, PRBS."""

TABLE_5 = MappingProxyType(
    {
        "I0": 0.3,
        "Ir1": 2.144e-4,
        "Ir": 0.0012,
        "Ip1": 1.072e-4,
        "Ip": 5.95e-4,
        "Cs1": 0.004536,
        "Cv1": 0.000429,
        "Cs": 0.3184,
        "Cv": 0.0444,
    }
)
"""All identified parameters by symbol, SI units (Ir is the paper's Ir2-3)."""

RESIDUAL = MappingProxyType({"mean": -1.4864e-4, "standard deviation": 0.0367})
"""Residual of eta1 on the validation experiment, figure 4 [m/s]."""

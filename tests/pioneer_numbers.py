"""The Pioneer paper's numbers, typed from print."""

import numpy as np

# The paper's tables 2 and 5 and its table of characteristics, with L = 0.1689 m.
PAPER = dict(
    M=15.5, m=0.35, m1=0.35, R=0.0825, R1=0.035, L=0.1689, l1=0.18, d=0.03, xm=0.0, ym=-0.07,
    I0=0.3, Ir1=2.144e-4, Ir=0.0012, Ip1=1.072e-4, Ip=5.95e-4, Cs=0.3184, Cv=0.0444, Cs1=0.004536, Cv1=0.000429,
    KT=0.023, KE=0.023, Ra=0.71, tr=19.7, mu=0.73, tau_fr=5.6e-3,
)  # fmt: skip
FREE = PAPER | dict(Cs=0.0, Cv=0.0, Cs1=0.0, Cv1=0.0, KE=0.0, tau_fr=0.0)  # no friction, no back-EMF
ON_THE_SPOT = np.array([0.3, -0.2, 0.5, -np.pi / 2, 0.0, 0.0, 0.0])

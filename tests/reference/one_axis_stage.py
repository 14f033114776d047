"""A dual-inertia stage in plain NumPy: thrust held, force held over a tenth of a sample, exact between.

Independent of the packages: written from M_r x_m'' = u' - C_r v_m - K (x_m - x_t) - C_k (v_m - v_t) and
M_t x_t'' = K (x_m - x_t) + C_k (v_m - v_t) - C_t v_t - F, u' the thrust after a first-order lag.
"""

import numpy as np
from scipy.linalg import expm

SUBSTEPS = 10


def run(drive, thrust, force, rate, ages=(0, 0, 0)):
    """Return motor and stage positions, shape (n,), for a commanded thrust (n,) and a force (10 n,).

    `drive` maps Mr Cr Mt Ct K Ck omega to numbers; `ages` of thrust, motor and stage in tenths of a sample.
    """
    h = 1.0 / (rate * SUBSTEPS)
    Mr, Cr, Mt, Ct, K, Ck, omega = (drive[k] for k in ("Mr", "Cr", "Mt", "Ct", "K", "Ck", "omega"))
    A = np.zeros((7, 7))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = [-K / Mr, -(Ck + Cr) / Mr, K / Mr, Ck / Mr, 1 / Mr, 0, 0]
    A[3] = [K / Mt, Ck / Mt, -K / Mt, -(Ck + Ct) / Mt, 0, 0, -1 / Mt]
    A[4, 4], A[4, 5] = -omega, omega
    step = expm(A * h)
    z = np.zeros(7)
    motor, stage = [np.zeros(len(force)) for _ in range(2)]
    held = np.repeat(thrust, SUBSTEPS)
    for n in range(len(force)):
        motor[n], stage[n] = z[0], z[2]
        z[5] = held[n - ages[0]] if n >= ages[0] else 0.0
        z[6] = force[n]
        z = step @ z
    old = [np.concatenate([np.zeros(a), x[: len(x) - a]]) for a, x in zip(ages[1:], (motor, stage), strict=True)]
    return old[0][::SUBSTEPS], old[1][::SUBSTEPS]

"""Compiled loop of the expanded Kalman filter.

=========  =====================  =================================================================
symbol     name in the API        meaning
=========  =====================  =================================================================
A, L       (steady gain)          transition over one sample, gain of the innovation
c, w       (rows)                 output row of the torque, output row of the force
=========  =====================  =================================================================
"""

import numpy as np
from numba import njit


@njit(cache=True, fastmath=False)
def steady_filter(y, A, L, c, w, x, new, out):
    """Predict, correct where there is a sample (not NaN), write the force after each correction.

    Parameters: y and out (n,); A (m, m) transposed, so that its rows run with the state; L, c, w (m,); x (m,): the
    state after the sample before, changed in place; new (m,): scratch.
    """
    size = x.size
    for k in range(y.size):
        for i in range(size):
            new[i] = 0.0
        for j in range(size):
            for i in range(size):
                new[i] += A[j, i] * x[j]
        e = 0.0
        if not np.isnan(y[k]):
            e = y[k]
            for i in range(size):
                e -= c[i] * new[i]
        force = 0.0
        for i in range(size):
            x[i] = new[i] + L[i] * e
            force += w[i] * x[i]
        out[k] = force

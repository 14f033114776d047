"""Independent look at the process with several modes: the receptance of the bar against the stiffness of the cut.

With q the bar at the tools, q = G F and F = -A q, the roots are those of det(I + G A); times the denominators of G it
has no poles. Written for many s at once, tool by tool, from the equations of the two forces.
"""

import numpy as np


def characteristic(s, modes, tools, damping, delays):
    """det(I + G A) prod(s^2 + 2 zeta w s + w^2) at `s`, shape (k,).

    modes: (mass, hertz, zeta, angle) of each; tools: (angle, K, Kt, mu, mu_t) of each, the angle that of its radius.
    """
    s = np.asarray(s, dtype=complex)
    receptance, poles = np.zeros((2, 2, *s.shape), dtype=complex), np.ones(s.shape, dtype=complex)
    for mass, hertz, zeta, angle in modes:
        w, d = 2 * np.pi * hertz, np.array([np.cos(angle), np.sin(angle)])
        bend = s**2 + 2 * zeta * w * s + w**2
        receptance += np.multiply.outer(np.outer(d, d), 1 / (mass * bend))
        poles = poles * bend
    cut = np.zeros_like(receptance)
    radii = [np.array([np.cos(tool[0]), np.sin(tool[0])]) for tool in tools]
    for i, (_, radial, tangential, mu, mu_t) in enumerate(tools):
        e, other, wave = radii[i], radii[1 - i], np.exp(-s * delays[i])
        w = np.array([-e[1], e[0]])
        for direction, stiffness, share in ((e, radial, mu), (w, tangential, mu_t)):
            cut += np.multiply.outer(stiffness * np.outer(direction, e), np.ones_like(s))
            cut -= np.multiply.outer(stiffness * share * np.outer(direction, other), wave)
        cut += np.multiply.outer(damping * np.outer(e, e), s)
    loop = np.einsum("ij...,jk...->ik...", receptance, cut)
    return ((1 + loop[0, 0]) * (1 + loop[1, 1]) - loop[0, 1] * loop[1, 0]) * poles

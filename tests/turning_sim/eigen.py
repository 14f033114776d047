"""Start a simulator on an eigenfunction of the linear theory and fit root and frequency to what it does."""

import math

import numpy as np
from scipy.optimize import least_squares

from tests.reference.plant_chip import dynamic_stiffness
from tests.reference.plant_plane import Plane
from tests.turning_sim.cases import bar, cut, immovable, run, simulator
from turning_sim.process import columns_of

QUIET_CUT = {"force_noise": 0.0, "setting_difference": 0.0, "rake_gain": 0.0, "flank_factor": 0.0}
MAP_PASSES = 12


def theory(position, *, shift=0.0, mapped=False, steady=False, bar_changes=None, **changes):
    """The linear theory of the usual cut; that of the map from its own brute-force derivatives."""
    modes = bar(**(bar_changes or {})).modes(position)
    if mapped:
        now, before = dynamic_stiffness(cut(), steady)
        numbers = {
            "stiffness": now[0], "tangential": now[1],
            "overlap": before[0] / now[0], "tangential_overlap": before[1] / now[1],
        }  # fmt: skip
    else:
        numbers = {"stiffness": 1.06e6, "tangential": 1.36 * 1.06e6, "overlap": 0.859, "tangential_overlap": 0.859}
    return Plane(**({"modes": modes, "process_damping": 33.0, "shift": shift} | numbers | changes))


def grow(model, linear, position, which, *, size=1e-9, bar_changes=None, cut_changes=None, substeps=6):
    """Return the root of the theory, and growth (1/s) and frequency (Hz) of the simulator in x over 0.2 s."""
    root = linear.roots()[which]
    moved = [
        started(model, linear, position, root, amplitude, bar_changes, cut_changes, substeps)
        for amplitude in ((size, 0.0) if linear.shift else (size,))
    ]
    # a shifted cut leaves its rest by some nanometres first: the same without an eigenfunction takes that away
    return root, *fitted(root, (moved[0] - (moved[1] if linear.shift else 0.0)) / size)


def started(model, linear, position, root, size, bar_changes, cut_changes, substeps):
    """Displacement of the bar towards tool 1 from sample 180 on, in units of the start."""
    shift, vector = linear.shift, size * linear.eigenvector(root)
    sim = simulator(
        bar_changes=bar_changes, cut_changes=QUIET_CUT | (cut_changes or {}), turret=immovable(), air_time=0.0,
        start_position=position, initial_shift=shift, substeps=substeps, model=model,
    )  # fmt: skip
    # the tools feed, which the map needs, but the bar stays as it is there
    sim._table = np.repeat(sim.workpiece.table(np.array([position])), sim._table.shape[0], axis=0)
    omega, state, tools = 40.0 * math.pi, sim._state, linear.tools()
    steady, rest = rest_of(sim, linear)
    angles = (shift, 0.0)

    def depth(tool, phase):
        e = tools[tool][0]
        return e @ rest + (e @ vector * np.exp(root * (phase + angles[tool]) / omega)).real

    for i in range(2):
        phase = state["phase"][i]
        state["left"][i] = depth(i, phase)
        if model.cut == "surface":
            history = np.stack([depth((i + k) % 2, phase - k * math.pi) for k in range(MAP_PASSES)])
            ahead = [0.15e-3 * angle / (2.0 * math.pi) for angle in (angles[i], angles[1 - i])]
            state["columns"][i] = columns_of(sim._grid, history, tuple(ahead))
    force, still = -linear.cut(root) @ vector, steady - linear.cut(0.0).real @ rest
    for m, mode in enumerate(linear.modes):
        moving = mode.shape * force / (mode.modal_mass * Plane.bend(mode, root))
        held = mode.shape * still / (mode.modal_mass * Plane.bend(mode, 0.0))
        state["bar"][m, 0::2] = held + moving.real
        state["bar"][m, 1::2] = (root * moving).real
    state["f"][8:10] = still + force.real
    return -run(sim, 0.2, shift)["bar_displacement"][180:]


def rest_of(sim, linear):
    """Steady force of both tools on the bar at nominal depth, and where the bar comes to rest under it."""
    radial, tangential = sim.cutting.steady_forces
    force = -sum(rise * (radial * e + tangential * w) for e, w, rise, _ in linear.tools())
    compliance = linear.compliance(0.0).real
    return force, np.linalg.solve(np.eye(2) + compliance * linear.cut(0.0).real, compliance * force)


def fitted(root, moved):
    """Growth (1/s) and frequency (Hz) of a motion known from sample 180 on."""
    time = np.arange(180, 180 + moved.size) / 9000.0
    weight = np.exp(-root.real * time)

    def misfit(change):
        e = np.exp((root + complex(*change)) * time)
        shape = np.stack([e.real, e.imag, np.ones(time.size)], axis=1) * weight[:, None]
        return shape @ np.linalg.lstsq(shape, moved * weight, rcond=None)[0] - moved * weight

    found = root + complex(*least_squares(misfit, [0.0, 0.0], xtol=1e-12).x)
    return found.real, found.imag / (2.0 * math.pi)

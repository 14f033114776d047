"""All recipes by name; a recipe and a seed make a recording."""

import zlib

import numpy as np

from tests.chatter.battery import simulated, spoilt, stable, unstable
from tests.chatter.battery.parts import Sample

RECIPES = {
    "stable_milling": stable.milling,
    "stable_milling_sound": stable.milling_sound,
    "stable_turning": stable.turning,
    "stable_interrupted": stable.interrupted,
    "stable_idle": stable.idle,
    "stable_noise": stable.noise,
    "stable_blows": stable.blows,
    "stable_ramp": stable.ramp,
    "stable_feed": stable.feed,
    "stable_encoder": stable.encoder,
    "stable_unfiltered": stable.unfiltered,
    "sim_milling_stable": simulated.sim_milling_stable,
    "sim_turning_stable": simulated.sim_turning_stable,
    "chatter_milling": unstable.milling,
    "chatter_milling_sound": unstable.milling_sound,
    "chatter_turning": unstable.turning,
    "chatter_short": unstable.short,
    "chatter_intermittent": unstable.intermittent,
    "chatter_two_modes": unstable.two_modes,
    "chatter_ramp": unstable.ramp,
    "chatter_servo": unstable.servo,
    "sim_milling_chatter": simulated.sim_milling_chatter,
    "sim_milling_flip": simulated.sim_milling_flip,
    "sim_turning_chatter": simulated.sim_turning_chatter,
    **spoilt.RECIPES,
}


def made(name: str, seed: int) -> Sample:
    """Return the recording of a recipe and a seed."""
    return RECIPES[name](np.random.default_rng([seed, zlib.crc32(name.encode())]))

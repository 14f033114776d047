"""Plant, monitor and decision derive the turret's geometry each on their own; here they must agree."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pitch
import turning_sim
from chatter.observers.nominal import NominalFeedDrive, NominalTurret

SHIFTS = st.floats(-0.34, 0.34)
DIAMETERS = st.floats(5e-3, 80e-3)
ANGLES = st.floats(0.4, 1.5)


@given(SHIFTS, DIAMETERS, ANGLES)
def test_plant_and_decision_put_the_slides_at_the_same_place(shift, diameter, angle):
    plant = turning_sim.slides_of_shift(shift, diameter, angle)
    decision = pitch.slide_set_points(shift, diameter, angle)
    assert np.allclose(plant, decision, rtol=1e-12, atol=1e-15)
    offset = turning_sim.tool_of_slides(*map(np.asarray, decision), angle)
    assert float(turning_sim.shift_of_tool(*offset, diameter)) == pytest.approx(shift, abs=1e-12)


@given(st.floats(-500, 500), st.floats(-500, 500), ANGLES)
def test_the_monitor_undoes_what_the_plant_does_to_a_force(force_x, force_y, angle):
    drive = NominalFeedDrive(
        lead=8e-3, rotor_inertia=4e-3, rotor_damping=0.0, stage_mass=250.0, stage_damping=0.0, screw_stiffness=1e8,
        screw_damping=0.0, motor_resolution=0.0, stage_resolution=0.0, motor_delay=0.0, stage_delay=0.0,
        thrust_delay=0.0, omega_current=3000.0,
    )  # fmt: skip
    loads = turning_sim.loads_of_force(force_x, force_y, angle)
    turret = NominalTurret(x1=drive, y1=drive, upper_mass=150.0, axis_angle=angle)
    assert turret.force_from_loads() @ np.array(loads) == pytest.approx([force_x, force_y], abs=1e-9)


@given(st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_loads_do_the_work_of_the_force(x1, y1):
    """Virtual work settles the sign: the loads oppose their slides and do minus the work of the force on the tool."""
    force_x, force_y, angle = 120.0, 160.0, math.pi / 4
    load_x, load_y = turning_sim.loads_of_force(force_x, force_y, angle)
    infeed, along = turning_sim.tool_of_slides(np.asarray(x1), np.asarray(y1), angle)
    assert -(load_x * x1 + load_y * y1) == pytest.approx(float(-force_x * infeed + force_y * along), abs=1e-12)
